//! How what is seen in mirrors and through glass moves.

use glam::{Mat3, Vec3};

/// Of a point, how its image in mirrors moves: with the velocity v of the point, at `turn v + drift`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Image {
    /// Mirrors turn velocities as they turn what is seen.
    turn: Mat3,
    /// What the mirrors' own motion adds, m/s.
    drift: Vec3,
}

impl Image {
    /// Of what is seen directly.
    pub(crate) const DIRECT: Image = Image { turn: Mat3::IDENTITY, drift: Vec3::ZERO };

    /// The image behind a mirror in this one, whose place there has the unit `normal` and moves at `velocity`, m/s.
    ///
    /// The image of p is `p - 2 ((p - m) . n) n`, with m a point of the mirror.
    #[must_use]
    pub(crate) fn in_mirror(self, normal: Vec3, velocity: Vec3) -> Image {
        let across = Mat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
        let drift = 2.0 * velocity.dot(normal) * normal;
        Image { turn: self.turn * (Mat3::IDENTITY - across * 2.0), drift: self.drift + self.turn * drift }
    }

    /// The image through a surface that bends light from `along` to `onward`, unit vectors: it is seen turned back.
    #[must_use]
    pub(crate) fn through(self, along: Vec3, onward: Vec3) -> Image {
        let back = glam::Quat::from_rotation_arc(onward, along);
        Image { turn: self.turn * Mat3::from_quat(back), ..self }
    }

    /// How fast the image of a point moves that moves at `velocity`, m/s.
    pub(crate) fn velocity(&self, velocity: Vec3) -> Vec3 {
        self.turn * velocity + self.drift
    }

    /// Where the image of a point goes in `time` s while the point goes `way`, m.
    pub(crate) fn way(&self, way: Vec3, time: f32) -> Vec3 {
        self.turn * way + self.drift * time
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two mirrors that move, by differences of the images' places.
    #[test]
    fn images_move_as_they_are_seen() {
        let mirrors = [
            (Vec3::new(0.6, 0.8, 0.0), Vec3::new(1.0, -2.0, 0.5), Vec3::new(3.0, 0.0, 0.0)),
            (Vec3::new(0.0, -0.6, 0.8), Vec3::new(-4.0, 0.0, 2.0), Vec3::new(0.0, 1.0, 7.0)),
        ];
        let (place, velocity) = (Vec3::new(5.0, 4.0, -3.0), Vec3::new(-1.0, 2.0, 6.0));
        let mut image = Image::DIRECT;
        for (normal, _, speed) in mirrors {
            image = image.in_mirror(normal, speed);
        }
        let seen = |time: f32| {
            // Of the last mirror's image the one before shows one.
            mirrors.iter().rev().fold(place + velocity * time, |point, (normal, at, speed)| {
                point - 2.0 * (point - (at + speed * time)).dot(*normal) * normal
            })
        };
        let way = seen(0.5) - seen(0.0);
        assert!((image.velocity(velocity) - way / 0.5).length() < 1e-4);
        assert!((image.way(velocity * 0.5, 0.5) - way).length() < 1e-4);
        let bent = Image::DIRECT.through(Vec3::X, Vec3::Y);
        assert!((bent.velocity(Vec3::Y) - Vec3::X).length() < 1e-6);
    }
}
