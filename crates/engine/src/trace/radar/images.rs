//! Planes that mirror waves, and the images of the radar behind them.

use glam::{DVec3, Vec3};

/// Most mirrors on a path, besides the facet that scatters.
pub(crate) const MOST_MIRRORS: usize = 3;

/// Heights, m, at which a place is in the plane of a mirror: rounding moves facets by less.
const IN_PLANE: f64 = 1e-5;

/// A plane that mirrors waves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mirror {
    /// Unit normal, world.
    pub normal: DVec3,
    /// A point of it, relative to the scene's origin, m.
    pub point: DVec3,
    /// Area of the facets in it, m^2.
    pub area: f64,
    /// Greatest distance of a facet from the point, m.
    pub radius: f64,
    /// The row of surfaces that it was found on, and its object.
    pub row: u32,
    pub object: u32,
}

impl Mirror {
    /// Height of a place above the plane, m.
    pub fn height(&self, place: DVec3) -> f64 {
        self.normal.dot(place - self.point)
    }

    /// The mirror image of a place.
    pub fn image(&self, place: DVec3) -> DVec3 {
        place - 2.0 * self.height(place) * self.normal
    }

    /// A direction after reflection.
    pub fn turned(&self, direction: DVec3) -> DVec3 {
        direction - 2.0 * self.normal.dot(direction) * self.normal
    }

    /// Whether another plane is the same, whichever side it faces.
    pub fn is_plane(&self, normal: DVec3, point: DVec3) -> bool {
        /// Sine of the angle between the normals, and offset, m.
        const NEAR: [f64; 2] = [1e-3, 1e-3];
        normal.cross(self.normal).length_squared() < NEAR[0] * NEAR[0] && self.height(point).abs() < NEAR[1]
    }
}

/// Mirrors in the order in which a wave meets them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MirrorChain {
    count: usize,
    mirrors: [Mirror; MOST_MIRRORS],
    /// The images of the place where the wave starts, after as many mirrors.
    images: [DVec3; MOST_MIRRORS + 1],
}

impl MirrorChain {
    /// The path from `start` that meets `mirrors`, at most [`MOST_MIRRORS`].
    pub fn new(start: DVec3, mirrors: impl Iterator<Item = Mirror>) -> MirrorChain {
        let nowhere = Mirror { normal: DVec3::Z, point: DVec3::ZERO, area: 0.0, radius: 0.0, row: 0, object: 0 };
        let mut all = MirrorChain { count: 0, mirrors: [nowhere; MOST_MIRRORS], images: [start; MOST_MIRRORS + 1] };
        for mirror in mirrors.take(MOST_MIRRORS) {
            all.mirrors[all.count] = mirror;
            all.images[all.count + 1] = mirror.image(all.images[all.count]);
            all.count += 1;
        }
        all
    }

    /// The mirrors.
    pub fn all(&self) -> &[Mirror] {
        &self.mirrors[..self.count]
    }

    /// The image of the start in all mirrors.
    pub fn image(&self) -> DVec3 {
        self.images[self.count]
    }

    /// The image of a target in all mirrors, as it appears from the start.
    pub fn target_image(&self, target: DVec3) -> DVec3 {
        self.all().iter().rev().fold(target, |place, mirror| mirror.image(place))
    }

    /// Where a wave to `target` meets the mirrors, after its start; `None`: it meets one from behind or not at all.
    pub fn bends(&self, target: DVec3) -> Option<[DVec3; MOST_MIRRORS]> {
        let mut bends = [target; MOST_MIRRORS];
        let mut to = target;
        for number in (0..self.count).rev() {
            let mirror = &self.mirrors[number];
            let from = self.images[number + 1];
            let [below, above] = [mirror.height(from), mirror.height(to)];
            // The image is behind the mirror, the target before it, not in it.
            if below * above >= 0.0 || above.abs() < IN_PLANE {
                return None;
            }
            to = from + (to - from) * (below / (below - above));
            bends[number] = to;
        }
        Some(bends)
    }

    /// Whether `bends` are as near to the middles of their mirrors as facets of these are, and `aside` m.
    pub fn hold(&self, bends: &[DVec3; MOST_MIRRORS], aside: f64) -> bool {
        // Places are as exact as single precision.
        let reach = |mirror: &Mirror| 1.001 * mirror.radius + 1e-3 + aside;
        self.all().iter().zip(bends).all(|(mirror, bend)| (*bend - mirror.point).length() < reach(mirror))
    }

    /// Directions of a wave to `target`: as it leaves the start, and after each mirror; unit vectors. `bends` are those of
    /// [`MirrorChain::bends`].
    pub fn directions(&self, target: DVec3, bends: &[DVec3; MOST_MIRRORS]) -> [Vec3; MOST_MIRRORS + 1] {
        let mut directions = [Vec3::ZERO; MOST_MIRRORS + 1];
        let mut from = self.images[0];
        for (number, direction) in directions.iter_mut().enumerate().take(self.count + 1) {
            let to = if number < self.count { bends[number] } else { target };
            *direction = (to - from).normalize_or_zero().as_vec3();
            from = to;
        }
        directions
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lengths are those to the image, and every bend is a reflection.
    #[test]
    fn paths_unfold() {
        let floor = Mirror { normal: DVec3::Z, point: DVec3::ZERO, area: 1.0, radius: 1.0, row: 0, object: 0 };
        let wall = Mirror {
            normal: DVec3::NEG_Y,
            point: DVec3::new(0.0, 4.0, 0.0),
            area: 1.0,
            radius: 1.0,
            row: 0,
            object: 1,
        };
        let start = DVec3::new(0.0, 0.0, 0.5);
        let mirrors = MirrorChain::new(start, [floor, wall].into_iter());
        let target = DVec3::new(20.0, 1.0, 1.5);
        let bends = mirrors.bends(target).unwrap();
        assert!(bends[0].z.abs() < 1e-12 && (bends[1].y - 4.0).abs() < 1e-12);
        let way = (bends[0] - start).length() + (bends[1] - bends[0]).length() + (target - bends[1]).length();
        assert!((way - (target - mirrors.image()).length()).abs() < 1e-12);
        assert!((way - (mirrors.target_image(target) - start).length()).abs() < 1e-12);
        let directions = mirrors.directions(target, &bends);
        assert!((floor.turned(directions[0].as_dvec3()).as_vec3() - directions[1]).length() < 1e-6);
        assert!((wall.turned(directions[1].as_dvec3()).as_vec3() - directions[2]).length() < 1e-6);
        // Behind the wall there is nothing to see in it.
        assert!(mirrors.bends(DVec3::new(20.0, 5.0, 1.5)).is_none());
    }
}
