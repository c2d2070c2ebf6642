//! Apparent motion of what is seen in mirrors and through glass.

use glam::{Mat3, Vec3};

/// How the image of a point in mirrors moves: at `turn v + drift`, with the velocity v of the point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MirrorImage {
    /// Mirrors reflect velocities as they reflect what is seen.
    turn: Mat3,
    /// Velocity added by the mirrors' own motion, m/s.
    drift: Vec3,
}

impl MirrorImage {
    /// For what is seen directly.
    pub(crate) const DIRECT: MirrorImage = MirrorImage { turn: Mat3::IDENTITY, drift: Vec3::ZERO };

    /// The image in a further mirror that is seen in this one; where it reflects, that mirror has the unit `normal` and
    /// moves at `velocity`, m/s.
    ///
    /// The image of p is `p - 2 ((p - m) . n) n`, with m a point of the mirror.
    #[must_use]
    pub(crate) fn in_mirror(self, normal: Vec3, velocity: Vec3) -> MirrorImage {
        let across = Mat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
        let drift = 2.0 * velocity.dot(normal) * normal;
        MirrorImage { turn: self.turn * (Mat3::IDENTITY - across * 2.0), drift: self.drift + self.turn * drift }
    }

    /// The image through a surface that refracts light from `along` to `onward`, unit vectors: it appears rotated back.
    #[must_use]
    pub fn through(self, along: Vec3, onward: Vec3) -> MirrorImage {
        let back = glam::Quat::from_rotation_arc(onward, along);
        MirrorImage { turn: self.turn * Mat3::from_quat(back), ..self }
    }

    /// Velocity of the image of a point that moves at `velocity`, m/s.
    pub fn velocity(&self, velocity: Vec3) -> Vec3 {
        self.turn * velocity + self.drift
    }

    /// Displacement of the image of a point in `time` s while the point is displaced by `way`, m.
    pub fn way(&self, way: Vec3, time: f32) -> Vec3 {
        self.turn * way + self.drift * time
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two moving mirrors, by differences of the images' positions.
    #[test]
    fn images_move_as_they_are_seen() {
        let mirrors = [
            (Vec3::new(0.6, 0.8, 0.0), Vec3::new(1.0, -2.0, 0.5), Vec3::new(3.0, 0.0, 0.0)),
            (Vec3::new(0.0, -0.6, 0.8), Vec3::new(-4.0, 0.0, 2.0), Vec3::new(0.0, 1.0, 7.0)),
        ];
        let (place, velocity) = (Vec3::new(5.0, 4.0, -3.0), Vec3::new(-1.0, 2.0, 6.0));
        let mut image = MirrorImage::DIRECT;
        for (normal, _, speed) in mirrors {
            image = image.in_mirror(normal, speed);
        }
        let seen = |time: f32| {
            // Each mirror shows an image of the next mirror's image.
            mirrors.iter().rev().fold(place + velocity * time, |point, (normal, at, speed)| {
                point - 2.0 * (point - (at + speed * time)).dot(*normal) * normal
            })
        };
        let way = seen(0.5) - seen(0.0);
        assert!((image.velocity(velocity) - way / 0.5).length() < 1e-4);
        assert!((image.way(velocity * 0.5, 0.5) - way).length() < 1e-4);
        let bent = MirrorImage::DIRECT.through(Vec3::X, Vec3::Y);
        assert!((bent.velocity(Vec3::Y) - Vec3::X).length() < 1e-6);
    }
}
