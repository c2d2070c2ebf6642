//! Human gait: feet are at rest while they are on the ground, which determines the angles of the joints.

use super::skeleton::JOINTS;
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Speed, m/s, and duration of two steps, s.
pub(super) const SPEED: f64 = 1.4;
const CYCLE: f64 = 1.0;
/// Keyframes of the joints in two steps.
const KEYS: f64 = 24.0;
/// Fractions of a cycle: the time a foot is on the ground, the time until it has rolled off its heel, and the time from
/// which the heel rises.
const STANCE: f64 = 0.6;
const FLAT: f64 = 0.1;
const RISING: f64 = 0.36;
/// Pitch of the foot, toes down, when the heel touches the ground and when the toes leave it.
const STRIKE: f64 = -0.33;
const PUSH: f64 = 0.85;
/// Position of the ankle relative to the heel and to the toes, along the foot and up.
const FROM_HEEL: DVec2 = DVec2::new(0.05, 0.08);
const FROM_TOES: DVec2 = DVec2::new(-0.16, 0.08);
/// Distance ahead of the hips at which the heel touches the ground.
const REACH: f64 = 0.27;
/// Lift of the foot, height of the hips, and amplitude of their bobbing; they are lowest when both feet are on the
/// ground.
const LIFT: f64 = 0.05;
const HIPS: f64 = 0.918;
const BOB: f64 = 0.019;

/// The pose of the joints at a time: the position of the hips, and the rotation of every joint relative to its parent.
pub(super) struct Gait {
    pub hips: DVec3,
    pub turns: [DQuat; JOINTS.len()],
}

/// Times of the keyframes.
pub(super) fn times(seconds: f64) -> Vec<f64> {
    let last = (seconds * KEYS / CYCLE).ceil() as u32;
    (0..=last).map(|key| seconds * f64::from(key) / f64::from(last)).collect()
}

/// From 0 to 1 with slope 0 at both ends.
fn smooth(part: f64) -> f64 {
    let part = part.clamp(0.0, 1.0);
    part * part * (3.0 - 2.0 * part)
}

/// Position of the ankle ahead of the hips and above the ground, and pitch of the foot, at a fraction of the foot's own
/// cycle.
fn foot(part: f64) -> (DVec2, f64) {
    let turned = |v: DVec2, pitch: f64| {
        let (sin, cos) = pitch.sin_cos();
        DVec2::new(v.x * cos + v.y * sin, v.y * cos - v.x * sin)
    };
    let heel = |part: f64| DVec2::new(REACH - SPEED * CYCLE * part, 0.0);
    let on_heel = |part: f64, pitch: f64| heel(part) + turned(FROM_HEEL, pitch);
    let on_toes =
        |part: f64, pitch: f64| heel(part) + FROM_HEEL.with_y(0.0) - FROM_TOES.with_y(0.0) + turned(FROM_TOES, pitch);
    if part < FLAT {
        let pitch = STRIKE * (1.0 - smooth(part / FLAT));
        return (on_heel(part, pitch), pitch);
    }
    if part < STANCE {
        let pitch = PUSH * ((part - RISING) / (STANCE - RISING)).max(0.0).powi(2);
        return (on_toes(part, pitch), pitch);
    }
    let part = (part - STANCE) / (1.0 - STANCE);
    let (from, to) = (on_toes(STANCE, PUSH), on_heel(0.0, STRIKE));
    // The foot leaves the ground and returns to it at about the speed that it has on it, backwards relative to the
    // hips.
    let back = -SPEED * CYCLE * (1.0 - STANCE) * 0.9;
    let (t, u) = (part, 1.0 - part);
    let x = from.x * u * u * (1.0 + 2.0 * t) + to.x * t * t * (1.0 + 2.0 * u) + back * t * u * (u - t);
    let z = from.y + (to.y - from.y) * smooth(part) + LIFT * (part * FRAC_PI_2 * 2.0).sin().powi(2);
    (DVec2::new(x, z), PUSH + (STRIKE - PUSH) * smooth(part / 0.85))
}

/// Hip and knee angles about y that bring the ankle to the position `to` relative to the hip, for these lengths of the
/// leg.
fn leg(to: DVec2, [thigh, shank]: [f64; 2]) -> [f64; 2] {
    let reach = to.length().min(0.9995 * (thigh + shank));
    let bend =
        |opposite: f64, a: f64, b: f64| ((a * a + b * b - opposite * opposite) / (2.0 * a * b)).clamp(-1.0, 1.0).acos();
    // A rotation about y turns a vector that points down towards -x, by the sine of the angle.
    let straight = (-to.x).atan2(-to.y);
    let hip = straight - bend(shank, thigh, reach);
    [hip, std::f64::consts::PI - bend(reach, thigh, shank)]
}

/// The gait at a time; `phase` is the fraction of a cycle by which it is ahead.
pub(super) fn gait(time: f64, phase: f64) -> Gait {
    let bound = |joint: usize| DVec3::from(JOINTS[joint].2);
    let part = time / CYCLE + phase;
    let cos = |turn: f64| ((part - turn) * TAU).cos();
    // The left heel touches the ground at 0, the right one at half.
    let swing = cos(0.05);
    let mut turns = [DQuat::IDENTITY; JOINTS.len()];
    let hips = DVec3::new(0.0, 0.012 * cos(0.3), HIPS - BOB * ((part - 0.05) * 2.0 * TAU).cos());
    let yaw = -0.08 * swing;
    let roll = 0.03 * cos(0.3);
    turns[0] = DQuat::from_rotation_z(yaw) * DQuat::from_rotation_x(roll);
    turns[1] = DQuat::from_rotation_z(-0.5 * yaw) * DQuat::from_rotation_x(-roll) * DQuat::from_rotation_y(0.03);
    turns[2] = DQuat::from_rotation_z(-1.3 * yaw);
    turns[3] = DQuat::from_rotation_z(0.5 * yaw) * DQuat::from_rotation_y(0.05);
    turns[4] = DQuat::from_rotation_z(0.3 * yaw) * DQuat::from_rotation_y(-0.07 + 0.015 * (part * 2.0 * TAU).cos());
    for (side, arm, upper) in [(1.0, 5, 11), (-1.0, 8, 14)] {
        // Arms, which are spread in the bind pose, hang down and swing opposite to the leg on the same side.
        let forward = -side * swing;
        let down = DQuat::from_rotation_x(-side * 0.6);
        turns[arm] = DQuat::from_rotation_y(0.04 - 0.42 * forward) * down;
        let elbow = DQuat::from_rotation_y(-0.38 - 0.2 * forward);
        turns[arm + 1] = down.inverse() * elbow * down;
        turns[arm + 2] = down.inverse() * DQuat::from_rotation_y(-0.08) * down;

        let own = if side > 0.0 { part } else { part + 0.5 };
        let (ankle, pitch) = foot(own.rem_euclid(1.0));
        let hip = hips + turns[0] * (bound(upper) - bound(0));
        let lengths = [0, 1].map(|bone| (bound(upper + bone + 1) - bound(upper + bone)).length());
        let [thigh, knee] = leg(ankle - DVec2::new(hip.x, hip.z), lengths);
        let [thigh, shank, foot] = [thigh, thigh + knee, pitch].map(DQuat::from_rotation_y);
        turns[upper] = turns[0].inverse() * thigh;
        turns[upper + 1] = thigh.inverse() * shank;
        turns[upper + 2] = shank.inverse() * foot;
    }
    Gait { hips, turns: turns.map(DQuat::normalize) }
}
