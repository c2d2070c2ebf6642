//! How people walk: the feet stand still on the ground, and the joints follow from that.

use super::person::JOINTS;
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Speed, m/s, and duration of two steps, s.
pub(super) const SPEED: f64 = 1.4;
const CYCLE: f64 = 1.0;
/// Keys of the joints in two steps.
const KEYS: f64 = 24.0;
/// Part of a cycle in which a foot is on the ground; until when it rolls off its heel, and from when the heel rises.
const STANCE: f64 = 0.6;
const FLAT: f64 = 0.1;
const RISING: f64 = 0.36;
/// Pitch of the foot, toes down, when the heel touches the ground and when the toes leave it.
const STRIKE: f64 = -0.33;
const PUSH: f64 = 0.85;
/// Ankle from the heel and from the toes, along the foot and up.
const FROM_HEEL: DVec2 = DVec2::new(0.05, 0.08);
const FROM_TOES: DVec2 = DVec2::new(-0.16, 0.08);
/// Where the heel touches the ground, before the hips.
const REACH: f64 = 0.27;
/// How high the foot is lifted, and the hips, which are lowest when both feet are on the ground.
const LIFT: f64 = 0.05;
const HIPS: f64 = 0.918;
const BOB: f64 = 0.019;

/// The joints at a time: the place of the hips, and how every joint is turned in its parent.
pub(super) struct Gait {
    pub hips: DVec3,
    pub turns: [DQuat; JOINTS.len()],
}

/// Times of the keys.
pub(super) fn times(seconds: f64) -> Vec<f64> {
    let last = (seconds * KEYS / CYCLE).ceil() as u32;
    (0..=last).map(|key| seconds * f64::from(key) / f64::from(last)).collect()
}

/// From 0 to 1 with slope 0 at both ends.
fn smooth(part: f64) -> f64 {
    let part = part.clamp(0.0, 1.0);
    part * part * (3.0 - 2.0 * part)
}

/// Ankle before the hips and above the ground, and pitch of the foot, at a part of the foot's own cycle.
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
    // The foot leaves the ground and comes back to it at about the speed that it has there, backwards.
    let back = -SPEED * CYCLE * (1.0 - STANCE) * 0.9;
    let (t, u) = (part, 1.0 - part);
    let x = from.x * u * u * (1.0 + 2.0 * t) + to.x * t * t * (1.0 + 2.0 * u) + back * t * u * (u - t);
    let z = from.y + (to.y - from.y) * smooth(part) + LIFT * (part * FRAC_PI_2 * 2.0).sin().powi(2);
    (DVec2::new(x, z), PUSH + (STRIKE - PUSH) * smooth(part / 0.85))
}

/// Hip and knee, as angles about y, that bring the ankle to a place from the hip; both lengths are the leg's.
fn leg(to: DVec2, [thigh, shank]: [f64; 2]) -> [f64; 2] {
    let reach = to.length().min(0.9995 * (thigh + shank));
    let bend =
        |opposite: f64, a: f64, b: f64| ((a * a + b * b - opposite * opposite) / (2.0 * a * b)).clamp(-1.0, 1.0).acos();
    // A turn by an angle about y moves what points down to -sin, against x.
    let straight = (-to.x).atan2(-to.y);
    let hip = straight - bend(shank, thigh, reach);
    [hip, std::f64::consts::PI - bend(reach, thigh, shank)]
}

/// The gait at a time; `phase` is the part of a cycle by which it is ahead.
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
        // Arms hang down from where they were spread, and swing against the leg of their side.
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
