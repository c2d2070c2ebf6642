//! Which surface contributes most to an echo, and which plane of that.

use glam::Vec3;
use ground::cause::Cause;
use ground::lanes::MEDIUM;

/// Cosine of the greatest angle, 8 degrees, between triangles that count as one plane where they are close together.
pub(crate) const PARALLEL: f32 = 0.99;

/// The plane of a surface where a ray hits it.
#[derive(Clone, Copy)]
pub(crate) struct SurfacePlane {
    /// A point on it.
    pub place: Vec3,
    pub normal: Vec3,
}

impl SurfacePlane {
    /// Whether `place` is on it, to within `off` m.
    pub fn holds(&self, place: Vec3, off: f32) -> bool {
        (place - self.place).dot(self.normal).abs() <= off
    }
}

/// A piece of a signal, or a ray, and the light that it contributes to an echo.
#[derive(Clone, Copy)]
pub(crate) struct Contributor {
    /// As in the signal.
    pub source: u32,
    /// m.
    pub range: f32,
    /// 1/m^2.
    pub light: f32,
}

/// What a plane of a surface contributes to an echo.
pub(crate) struct Share {
    surface: u32,
    cause: Cause,
    /// None for what no ray hits directly.
    plane: Option<SurfacePlane>,
    light: f32,
    /// Light of all planes of the surface, at the first of them.
    of_surface: f32,
    strongest: Contributor,
}

/// The strongest contributor to an echo.
pub(crate) struct StrongestContributor {
    pub contributor: Contributor,
    /// Light of the echo.
    pub light: f32,
    /// None for what no ray hits directly.
    pub plane: Option<SurfacePlane>,
}

/// Where a piece of a signal comes from.
#[derive(Clone, Copy)]
pub(crate) struct PieceOrigin {
    pub surface: u32,
    pub cause: Cause,
    /// Where it meets its surface, and the normal there, if a ray hits that directly.
    pub plane: Option<SurfacePlane>,
}

impl PieceOrigin {
    pub const NOWHERE: PieceOrigin = PieceOrigin { surface: MEDIUM, cause: Cause::Surface, plane: None };
}

/// The strongest of an echo's `contributors`: of the surface that contributes most the plane that does, and of that the
/// contributor. `origin` gives the origin of each; what is within `apart` m of a plane, and parallel, is on it. `shares`
/// is working memory. Of equals, the first.
pub(crate) fn strongest_contributor(
    contributors: impl Iterator<Item = Contributor>,
    origin: impl Fn(&Contributor) -> PieceOrigin,
    apart: f32,
    shares: &mut Vec<Share>,
) -> Option<StrongestContributor> {
    let is_on = |of: &Share, plane: Option<SurfacePlane>| match (of.plane, plane) {
        (Some(here), Some(SurfacePlane { place, normal })) => {
            here.holds(place, apart) && here.normal.dot(normal).abs() >= PARALLEL
        }
        (here, plane) => here.is_some() == plane.is_some(),
    };
    shares.clear();
    let mut all = 0.0;
    for from in contributors {
        let PieceOrigin { surface, cause, plane } = origin(&from);
        all += from.light;
        let is_same = |share: &&mut Share| (share.surface, share.cause) == (surface, cause);
        let mut same = shares.iter_mut().filter(is_same);
        let new = Share { surface, cause, plane, light: from.light, of_surface: from.light, strongest: from };
        let Some(first) = same.next() else {
            shares.push(new);
            continue;
        };
        first.of_surface += from.light;
        match std::iter::once(first).chain(same).find(|share| is_on(share, plane)) {
            Some(share) => {
                share.light += from.light;
                if from.light > share.strongest.light {
                    share.strongest = from;
                }
            }
            None => shares.push(Share { of_surface: 0.0, ..new }),
        }
    }
    let first = greatest(shares.iter(), |share| share.of_surface)?;
    let of_surface = shares.iter().filter(|share| (share.surface, share.cause) == (first.surface, first.cause));
    let Share { plane, strongest, .. } = *greatest(of_surface, |share| share.light)?;
    Some(StrongestContributor { contributor: strongest, light: all, plane })
}

/// The first of the `shares` with the greatest `light`.
fn greatest<'a>(shares: impl Iterator<Item = &'a Share>, light: impl Fn(&Share) -> f32) -> Option<&'a Share> {
    shares.reduce(|greatest, share| if light(share) > light(greatest) { share } else { greatest })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Surface, direction of the normal, light; the source is the number.
    fn strongest(of: &[(u32, Vec3, f32)]) -> u32 {
        let contributors = (0..).zip(of).map(|(source, &(.., light))| Contributor { source, range: 10.0, light });
        let origin = |from: &Contributor| {
            let (surface, normal, _) = of[from.source as usize];
            PieceOrigin { surface, cause: Cause::Surface, plane: Some(SurfacePlane { place: normal, normal }) }
        };
        let found = strongest_contributor(contributors, origin, 0.03, &mut Vec::new()).unwrap();
        assert!((found.light - of.iter().map(|(.., light)| light).sum::<f32>()).abs() < 1e-6);
        assert_eq!(found.plane.unwrap().normal, of[found.contributor.source as usize].1);
        found.contributor.source
    }

    #[test]
    fn of_the_strongest_surface_the_strongest_plane() {
        assert_eq!(
            strongest(&[(1, Vec3::X, 0.4), (2, Vec3::X, 0.3), (2, Vec3::Y, 0.31)]),
            2,
            "one surface, two planes"
        );
        assert_eq!(strongest(&[(2, Vec3::X, 0.2), (2, Vec3::Y, 0.3), (2, Vec3::X, 0.21)]), 2, "one plane, two pieces");
        assert_eq!(strongest(&[(1, Vec3::X, 0.5), (2, Vec3::X, 0.5)]), 0, "the first of equals");
        assert!(strongest_contributor([].into_iter(), |_| PieceOrigin::NOWHERE, 0.03, &mut Vec::new()).is_none());
    }
}
