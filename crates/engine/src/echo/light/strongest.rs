//! Which surface contributes most to an echo, and whether others contribute much.

use super::{Arrivals, Pulselet};
use glam::Vec3;
use ground::cause::Cause;

/// What a plane of a surface contributes to an echo.
pub(crate) struct Share {
    surface: u32,
    cause: Cause,
    /// A point on it and its normal; none for what no ray hits directly.
    plane: Option<(Vec3, Vec3)>,
    light: f32,
    /// Light of its strongest part, and the source of that.
    most: f32,
    source: u32,
}

/// The strongest contributor to an echo.
pub(crate) struct StrongestContributor {
    /// Its strongest arrival: a row of [`Arrivals`].
    pub source: u32,
    /// Light of the echo, and how much of that comes from off the contributor's plane; none where it has no plane.
    pub light: f32,
    pub elsewhere: f32,
}

/// The strongest contributor to the echo that `parts` form, each with the light that `light` gives. `plane`: where a
/// part meets its surface, and the normal there, for what rays hit directly; within `apart` m of a plane is on it.
/// `shares` is working memory. Of those that contribute equally, the first.
pub(crate) fn strongest_contributor<'a>(
    arrivals: &Arrivals,
    parts: impl Iterator<Item = &'a Pulselet> + Clone,
    light: impl Fn(&Pulselet) -> f32,
    plane: impl Fn(&Pulselet) -> Option<(Vec3, Vec3)>,
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
        let (light, plane, from) = (light(part), plane(part), arrivals.provenance(part.source));
        let is_same = |share: &Share| (share.surface, share.cause) == (from.surface, from.cause) && !off(share, plane);
        all += light;
        match shares.iter_mut().find(|share| is_same(share)) {
            Some(share) => {
                share.light += light;
                if light > share.most {
                    (share.most, share.source) = (light, part.source);
                }
            }
            None => shares.push(Share {
                surface: from.surface,
                cause: from.cause,
                plane,
                light,
                most: light,
                source: part.source,
            }),
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
        elsewhere = parts.filter(|part| off(greatest, plane(part))).map(light).sum();
    }
    Some(StrongestContributor { source: greatest.source, light: all, elsewhere })
}
