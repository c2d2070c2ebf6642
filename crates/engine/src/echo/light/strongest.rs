//! Which surface contributes most to an echo, and whether others contribute much.

use super::Pulselet;
use glam::Vec3;
use ground::cause::Cause;
use ground::lanes::MEDIUM;

/// What a plane of a surface contributes to an echo.
pub(crate) struct Share {
    surface: u32,
    cause: Cause,
    /// A point on it and its normal; none for what no ray hits directly.
    plane: Option<(Vec3, Vec3)>,
    light: f32,
    /// Light of its strongest part, and that part.
    most: f32,
    part: Pulselet,
}

/// The strongest contributor to an echo.
pub(crate) struct StrongestContributor {
    /// Its strongest part.
    pub part: Pulselet,
    /// Light of the echo, and how much of that comes from off the contributor's plane; none where it has no plane.
    pub light: f32,
    pub elsewhere: f32,
}

/// Where a part of a signal comes from.
#[derive(Clone, Copy)]
pub(crate) struct Origin {
    pub surface: u32,
    pub cause: Cause,
    /// Where it meets its surface, and the normal there, if a ray hits that directly.
    pub plane: Option<(Vec3, Vec3)>,
}

impl Origin {
    pub const NOWHERE: Origin = Origin { surface: MEDIUM, cause: Cause::Surface, plane: None };
}

/// The strongest contributor to the echo that `parts` form, each with the light that `light` gives and the origin that
/// `origin` does; within `apart` m of a plane is on it. `shares` is working memory. Of those that contribute equally,
/// the first.
pub(crate) fn strongest_contributor<'a>(
    parts: impl Iterator<Item = &'a Pulselet> + Clone,
    light: impl Fn(&Pulselet) -> f32,
    origin: impl Fn(&Pulselet) -> Origin,
    apart: f32,
    shares: &mut Vec<Share>,
) -> Option<StrongestContributor> {
    let off = |of: &Share, plane: Option<(Vec3, Vec3)>| match (of.plane, plane) {
        (Some((here, normal)), Some((place, _))) => (place - here).dot(normal).abs() > apart,
        (here, plane) => here.is_some() != plane.is_some(),
    };
    shares.clear();
    let mut all = 0.0;
    for part in parts.clone() {
        let (light, Origin { surface, cause, plane }) = (light(part), origin(part));
        let is_same = |share: &Share| (share.surface, share.cause) == (surface, cause) && !off(share, plane);
        all += light;
        match shares.iter_mut().find(|share| is_same(share)) {
            Some(share) => {
                share.light += light;
                if light > share.most {
                    (share.most, share.part) = (light, *part);
                }
            }
            None => shares.push(Share { surface, cause, plane, light, most: light, part: *part }),
        }
    }
    let mut greatest = shares.first()?;
    for share in shares.iter() {
        if share.light > greatest.light {
            greatest = share;
        }
    }
    let mut elsewhere = 0.0;
    if greatest.plane.is_some() {
        elsewhere = parts.filter(|part| off(greatest, origin(part).plane)).map(light).sum();
    }
    Some(StrongestContributor { part: greatest.part, light: all, elsewhere })
}
