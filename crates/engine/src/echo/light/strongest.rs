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
    /// Light of its strongest piece, and that piece.
    most: f32,
    piece: Pulselet,
}

/// The strongest contributor to an echo.
pub(crate) struct StrongestContributor {
    /// Its strongest piece.
    pub piece: Pulselet,
    /// Light of the echo, and how much of that comes from off the contributor's plane; none where it has no plane.
    pub light: f32,
    pub elsewhere: f32,
}

/// Where a piece of a signal comes from.
#[derive(Clone, Copy)]
pub(crate) struct PieceOrigin {
    pub surface: u32,
    pub cause: Cause,
    /// Where it meets its surface, and the normal there, if a ray hits that directly.
    pub plane: Option<(Vec3, Vec3)>,
}

impl PieceOrigin {
    pub const NOWHERE: PieceOrigin = PieceOrigin { surface: MEDIUM, cause: Cause::Surface, plane: None };
}

/// The strongest contributor to the echo that `pieces` form, each with the light that `light` gives and the origin that
/// `origin` does; `part_off` gives the part of a piece more than a distance in m off a plane, within `apart` of which is
/// on it. `shares` is working memory. Of those that contribute equally, the first.
pub(crate) fn strongest_contributor<'a>(
    pieces: impl Iterator<Item = &'a Pulselet> + Clone,
    light: impl Fn(&Pulselet) -> f32,
    origin: impl Fn(&Pulselet) -> PieceOrigin,
    part_off: impl Fn(&Pulselet, (Vec3, Vec3), f32) -> f32,
    apart: f32,
    shares: &mut Vec<Share>,
) -> Option<StrongestContributor> {
    let off = |of: &Share, plane: Option<(Vec3, Vec3)>| match (of.plane, plane) {
        (Some((here, normal)), Some((place, _))) => (place - here).dot(normal).abs() > apart,
        (here, plane) => here.is_some() != plane.is_some(),
    };
    shares.clear();
    let mut all = 0.0;
    for piece in pieces.clone() {
        let (light, PieceOrigin { surface, cause, plane }) = (light(piece), origin(piece));
        let is_same = |share: &Share| (share.surface, share.cause) == (surface, cause) && !off(share, plane);
        all += light;
        match shares.iter_mut().find(|share| is_same(share)) {
            Some(share) => {
                share.light += light;
                if light > share.most {
                    (share.most, share.piece) = (light, *piece);
                }
            }
            None => shares.push(Share { surface, cause, plane, light, most: light, piece: *piece }),
        }
    }
    let mut greatest = shares.first()?;
    for share in shares.iter() {
        if share.light > greatest.light {
            greatest = share;
        }
    }
    let elsewhere =
        greatest.plane.map_or(0.0, |plane| pieces.map(|piece| light(piece) * part_off(piece, plane, apart)).sum());
    Some(StrongestContributor { piece: greatest.piece, light: all, elsewhere })
}
