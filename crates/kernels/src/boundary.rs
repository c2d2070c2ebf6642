//! Light at smooth boundaries: what is reflected, what is transmitted, and where it goes.

use crate::level::kernels;
use crate::math::exp_negative;
use crate::{LANES, Lanes};

/// Light paths side by side at the surfaces they hit, with what determines how each continues.
#[repr(align(64))]
pub struct Meetings {
    /// Range so far as the instrument measures it, m.
    pub range: Lanes,
    /// Length so far over which light spreads, m.
    pub spread: Lanes,
    /// Path length so far, m.
    pub length: Lanes,
    /// Part of the light that is left, one way.
    pub part: Lanes,
    /// Medium of the last segment: range and spread over its length, absorption, 1/m.
    pub through: [Lanes; 3],
    /// Part that the surface mirrors whatever its material, 0..1.
    pub mirrored: Lanes,
    /// Part that obeys Fresnel's equations, 0..1.
    pub clear: Lanes,
    /// Index behind the surface over that in front of it.
    pub index: Lanes,
    /// Thickness of the pane that the surface represents, m; below 0 it is the face of a body.
    pub pane: Lanes,
    /// As `through`, for the pane, or for the medium behind the face of a body.
    pub within: [Lanes; 3],
    /// How the face of a body reflects: 0 totally or not at all, 1 by Fresnel's equations.
    pub partly: Lanes,
    /// Positions of the hits, m.
    pub place: [Lanes; 3],
    /// Angle of incidence, exact near 0, rad.
    pub angle: Lanes,
    /// Part that is reflected.
    pub reflected: Lanes,
}

/// Continuing paths side by side.
#[repr(align(64))]
pub struct Onward {
    /// Start of the next segment.
    pub origin: [Lanes; 3],
    /// Its direction, a unit vector.
    pub direction: [Lanes; 3],
    /// As [`Meetings::range`].
    pub range: Lanes,
    /// As [`Meetings::spread`].
    pub spread: Lanes,
    /// As [`Meetings::length`].
    pub length: Lanes,
    /// As [`Meetings::part`]; 0 where no light continues.
    pub part: Lanes,
}

impl Default for Meetings {
    fn default() -> Self {
        Meetings {
            range: [0.0; LANES],
            spread: [0.0; LANES],
            length: [0.0; LANES],
            part: [0.0; LANES],
            through: [[0.0; LANES]; 3],
            mirrored: [0.0; LANES],
            clear: [0.0; LANES],
            index: [1.0; LANES],
            pane: [0.0; LANES],
            within: [[0.0; LANES]; 3],
            partly: [1.0; LANES],
            place: [[0.0; LANES]; 3],
            angle: [0.0; LANES],
            reflected: [0.0; LANES],
        }
    }
}

impl Default for Onward {
    fn default() -> Self {
        Onward {
            origin: [[0.0; LANES]; 3],
            direction: [[0.0; LANES]; 3],
            range: [0.0; LANES],
            spread: [0.0; LANES],
            length: [0.0; LANES],
            part: [0.0; LANES],
        }
    }
}

kernels! {
    /// Adds the last segment of the first `count` paths, of these `lengths`, along `direction` from `origin`.
    pub fn arrive(at: &mut Meetings, origin: [&Lanes; 3], direction: [&Lanes; 3], lengths: &Lanes, count: usize) {
        let Meetings { range, spread, length, part, through: [slower, wider, absorption], place, .. } = at;
        let lanes = count.next_multiple_of(N).min(LANES);
        for lane in 0..lanes {
            range[lane] += lengths[lane] * slower[lane];
            spread[lane] += lengths[lane] * wider[lane];
            length[lane] += lengths[lane];
            part[lane] *= exp_negative(absorption[lane] * lengths[lane]);
        }
        for axis in 0..3 {
            for lane in 0..lanes {
                place[axis][lane] = origin[axis][lane] + direction[axis][lane] * lengths[lane];
            }
        }
    }

    /// Divides the light of the first `count` paths, which travels `along`, at surfaces whose unit `normals` face it,
    /// at cosines of incidence `cos`. `facets` are the unit normals of their triangles on the same side: reflected
    /// light stays on that side, refracted light gets to the other. `simple`: panes reflect at their first face only
    /// and transmit all the rest.
    pub fn divide(
        at: &mut Meetings,
        along: [&Lanes; 3],
        normals: [&Lanes; 3],
        facets: [&Lanes; 3],
        cos: &Lanes,
        simple: bool,
        count: usize,
        mirrored: &mut Onward,
        refracted: &mut Onward,
    ) {
        for chunk in (0..count.min(LANES)).step_by(N) {
            let lanes = chunk..chunk + N;
            // Most surfaces scatter all light.
            if at.clear[lanes.clone()].iter().chain(&at.mirrored[lanes.clone()]).all(|&part| part <= 0.0) {
                at.reflected[lanes.clone()].fill(0.0);
                mirrored.part[lanes.clone()].fill(0.0);
                refracted.part[lanes].fill(0.0);
                continue;
            }
            let (mut d, mut n, mut g, mut place) = ([[0.0; N]; 3], [[0.0; N]; 3], [[0.0; N]; 3], [[0.0; N]; 3]);
            for axis in 0..3 {
                d[axis].copy_from_slice(&along[axis][chunk..chunk + N]);
                n[axis].copy_from_slice(&normals[axis][chunk..chunk + N]);
                g[axis].copy_from_slice(&facets[axis][chunk..chunk + N]);
                place[axis].copy_from_slice(&at.place[axis][chunk..chunk + N]);
            }
            let (mut cos_i, mut cos_g) = ([0.0; N], [0.0; N]);
            for lane in 0..N {
                (cos_i[lane], cos_g[lane]) = lift(&d, &mut n, &g, cos[chunk + lane], lane);
            }
            let mut off = [0.0; N];
            let (mut share, mut pass, mut cos_t, mut inside) = ([0.0; N], [0.0; N], [0.0; N], [0.0; N]);
            for lane in 0..N {
                // Off the surface by the rounding error of single precision there.
                let farthest = place[0][lane].abs().max(place[1][lane].abs()).max(place[2][lane].abs());
                off[lane] = 1e-5 + 1e-6 * farthest;
                let to = chunk + lane;
                let (index, pane) = (at.index[to], at.pane[to]);
                let (face, cosine) = dielectric(cos_i[lane], index);
                // A pane.
                let is_pane = pane >= 0.0;
                let through = if is_pane { pane / cosine } else { 0.0 };
                let left = exp_negative(at.within[2][to] * through);
                let (both, passed) = plate(cos_i[lane], cosine, index, left);
                let (both, passed) = if simple { (face, 1.0 - face) } else { (both, passed) };
                // A body.
                let own = if face < 1.0 { face * at.partly[to] } else { face };
                let fresnel = if is_pane { both } else { own };
                let clear = at.clear[to];
                share[lane] = at.mirrored[to] + clear * fresnel;
                pass[lane] = clear * if is_pane { passed } else { 1.0 - own };
                cos_t[lane] = cosine;
                inside[lane] = through;
            }
            for lane in 0..N {
                let to = chunk + lane;
                let along = d[0][lane] * n[0][lane] + d[1][lane] * n[1][lane] + d[2][lane] * n[2][lane];
                // Near normal incidence the difference of the directions is the angle, and exact where the cosine
                // rounds to 1.
                let apart = [d[0][lane] + n[0][lane], d[1][lane] + n[1][lane], d[2][lane] + n[2][lane]];
                at.angle[to] = (apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2]).sqrt();
                at.reflected[to] = share[lane];
                let [back, up] = clearance(off[lane], cos_g[lane]);
                let mut skipped = 0.0;
                for axis in 0..3 {
                    let direction = d[axis][lane] - n[axis][lane] * (2.0 * along);
                    // Back along the incoming path, which is clear of other surfaces, too.
                    let clear = g[axis][lane] * up - d[axis][lane] * back;
                    mirrored.direction[axis][to] = direction;
                    mirrored.origin[axis][to] = place[axis][lane] + clear;
                    skipped += clear * direction;
                }
                mirrored.range[to] = at.range[to] + skipped * at.through[0][to];
                mirrored.spread[to] = at.spread[to] + skipped * at.through[1][to];
                mirrored.length[to] = at.length[to] + skipped;
                mirrored.part[to] = at.part[to] * share[lane];
            }
            for lane in 0..N {
                let to = chunk + lane;
                let index = at.index[to];
                let along = d[0][lane] * n[0][lane] + d[1][lane] * n[1][lane] + d[2][lane] * n[2][lane];
                // Snell's law.
                let bend = -along / index - cos_t[lane];
                let (x, y, z) = (
                    d[0][lane] / index + n[0][lane] * bend,
                    d[1][lane] / index + n[1][lane] * bend,
                    d[2][lane] / index + n[2][lane] * bend,
                );
                let down = -(x * g[0][lane] + y * g[1][lane] + z * g[2][lane]);
                let lower = (LEVEL - down).max(0.0);
                let (x, y, z) = (x - lower * g[0][lane], y - lower * g[1][lane], z - lower * g[2][lane]);
                let scale = 1.0 / (x * x + y * y + z * z).sqrt();
                let bent = [x * scale, y * scale, z * scale];
                // Behind a pane light continues in its old direction, from the other face.
                let is_pane = at.pane[to] >= 0.0;
                let on = if is_pane { cos_g[lane] } else { (down + lower) * scale };
                let [ahead, up] = clearance(off[lane], on);
                for axis in 0..3 {
                    let direction = if is_pane { d[axis][lane] } else { bent[axis] };
                    let clear = direction * ahead - g[axis][lane] * up;
                    refracted.direction[axis][to] = direction;
                    refracted.origin[axis][to] = place[axis][lane] + bent[axis] * inside[lane] + clear;
                }
                let skipped = ahead + up * on;
                let [slower, wider] = [0, 1].map(|k| if is_pane { at.through[k][to] } else { at.within[k][to] });
                refracted.range[to] = at.range[to] + inside[lane] * at.within[0][to] + skipped * slower;
                refracted.spread[to] = at.spread[to] + inside[lane] * at.within[1][to] + skipped * wider;
                refracted.length[to] = at.length[to] + skipped;
                refracted.part[to] = at.part[to] * pass[lane];
            }
        }
    }
}

/// Least cosine of the angle between a triangle's normal and light leaving the triangle.
const LEVEL: f32 = 1e-3;

/// Displacement along a ray, and in addition along the normal of a surface, to a point that is `off` the surface, m: on
/// the ray itself, unless it grazes the surface. `cos`: between them.
#[inline(always)]
pub fn clearance(off: f32, cos: f32) -> [f32; 2] {
    let along = off / cos.max(0.25);
    [along, (off - along * cos).max(0.0)]
}

/// Raises a shading normal that would reflect light through its triangle so far that the light leaves parallel to the
/// triangle, as Blender's Cycles does (`ensure_valid_specular_reflection`). Returns the cosines of incidence on both,
/// `cos` if nothing changes.
#[inline(always)]
fn lift<const N: usize>(
    d: &[[f32; N]; 3],
    n: &mut [[f32; N]; 3],
    g: &[[f32; N]; 3],
    cos: f32,
    lane: usize,
) -> (f32, f32) {
    let dot = |a: &[[f32; N]; 3], b: &[[f32; N]; 3]| {
        a[0][lane] * b[0][lane] + a[1][lane] * b[1][lane] + a[2][lane] * b[2][lane]
    };
    let (along, of_facet, between) = (dot(d, n), -dot(d, g), dot(n, g));
    let up = -of_facet - 2.0 * along * between;
    let raised = ((0.9 * of_facet).min(LEVEL) - up).max(0.0);
    // The half vector between incoming and outgoing light.
    let half = [0, 1, 2].map(|axis| raised * g[axis][lane] - 2.0 * along * n[axis][lane]);
    let mirrored = [0, 1, 2].map(|axis| d[axis][lane] + half[axis]);
    let length = (mirrored[0] * mirrored[0] + mirrored[1] * mirrored[1] + mirrored[2] * mirrored[2]).sqrt();
    let half = [0, 1, 2].map(|axis| mirrored[axis] / length - d[axis][lane]);
    let size = (half[0] * half[0] + half[1] * half[1] + half[2] * half[2]).sqrt();
    if raised > 0.0 {
        for axis in 0..3 {
            n[axis][lane] = half[axis] / size;
        }
    }
    (if raised > 0.0 { 0.5 * size } else { cos }, of_facet)
}

/// Reflectance of a smooth boundary for unpolarised light, 0..1, and the cosine of the refracted direction; total
/// reflection gives 1 and 0. `cos`: of the incidence angle, 0..1. `m`: index behind the boundary over that in front of
/// it.
///
/// Uses the amplitudes of Fresnel's equations, `r_s = (c_i - m c_t) / (c_i + m c_t)`,
/// `r_p = (m c_i - c_t) / (m c_i + c_t)`, which the paper's eq. 12 writes as quotients of tangents and sines, 0/0 at
/// normal incidence.
#[inline(always)]
pub fn dielectric(cos: f32, m: f32) -> (f32, f32) {
    let sin2 = (1.0 - cos * cos) / (m * m);
    let cos_t = (1.0 - sin2).max(0.0).sqrt();
    let (s, p) = amplitudes(cos, cos_t, m);
    if sin2 >= 1.0 { (1.0, 0.0) } else { ((s * s + p * p) / 2.0, cos_t) }
}

#[inline(always)]
fn amplitudes(cos: f32, cos_t: f32, m: f32) -> (f32, f32) {
    ((cos - m * cos_t) / (cos + m * cos_t), (m * cos - cos_t) / (m * cos + cos_t))
}

/// Reflectance and transmittance of a plate of index `n`, with all reflections between its faces, summed as powers for
/// each polarisation: `T = (1-R)^2 A / (1 - R^2 A^2)`, `R' = R + R (1-R)^2 A^2 / (1 - R^2 A^2)`. `pass`: what is left
/// after one pass, `A`; `cos_t`: as in [`dielectric`]. Total reflection does not occur: both sides are air.
#[inline(always)]
pub fn plate(cos: f32, cos_t: f32, n: f32, pass: f32) -> (f32, f32) {
    let (s, p) = amplitudes(cos, cos_t, n);
    let polarised = |r: f32| {
        let between = (1.0 - r) * (1.0 - r) / (1.0 - r * r * pass * pass).max(f32::MIN_POSITIVE);
        (r + r * between * pass * pass, between * pass)
    };
    let (s, p) = (polarised(s * s), polarised(p * p));
    ((s.0 + p.0) / 2.0, (s.1 + p.1) / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cos(degrees: f32) -> f32 {
        degrees.to_radians().cos()
    }

    /// Values computed with numpy from Fresnel's equations.
    #[test]
    fn dielectric_table() {
        for (m, degrees, expected) in [
            (1.5, 0.0, 0.04),
            (1.5, 30.0, 0.041_522_6),
            (1.5, 45.0, 0.050_239_9),
            (1.5, 60.0, 0.089_186_7),
            (1.5, 75.0, 0.253_060_6),
            (1.5, 85.0, 0.612_799_6),
            (1.33, 0.0, 0.020_059_3),
        ] {
            let (found, cos_t) = dielectric(cos(degrees), m);
            assert!((found - expected).abs() < 1e-5, "{m} {degrees}: {found}");
            // The same part in the reverse direction.
            let (back, _) = dielectric(cos_t, 1.0 / m);
            assert!((back - found).abs() < 1e-5, "{m} {degrees}: {back}");
        }
        for (m, degrees) in [(1.0 / 1.5, 42.0), (1.0 / 1.5, 60.0), (1.0 / 1.33, 60.0)] {
            assert_eq!(dielectric(cos(degrees), m), (1.0, 0.0));
        }
        // The critical angle, from glass and from water.
        for (index, critical) in [(1.5, 41.810_31), (1.33, 48.753_47)] {
            assert_eq!(dielectric(cos(critical + 5e-5), 1.0 / index).0, 1.0);
            assert!(dielectric(cos(critical - 5e-5), 1.0 / index).0 < 1.0);
        }
        // At grazing incidence everything is reflected.
        for m in [1.5, 1.33, 1.0 / 1.5] {
            assert_eq!(dielectric(0.0, m).0, 1.0);
        }
        // Brewster's angle: nothing of the light in the plane of incidence.
        let brewster = cos(56.309_93);
        let (_, cos_t) = dielectric(brewster, 1.5);
        assert!(amplitudes(brewster, cos_t, 1.5).1.abs() < 1e-6);
        assert_eq!(dielectric(0.5, 1.0).0, 0.0);
    }

    /// Transmission of a pane of index 1.5, without and with absorption.
    #[test]
    fn plate_table() {
        for (degrees, expected) in
            [(0.0, 0.923_077), (30.0, 0.920_734), (45.0, 0.907_344), (60.0, 0.848_128), (75.0, 0.618_149)]
        {
            let cos = cos(degrees);
            let (reflected, passed) = plate(cos, dielectric(cos, 1.5).1, 1.5, 1.0);
            assert!((passed - expected).abs() < 2e-6, "{degrees}: {passed}");
            assert!((reflected + passed - 1.0).abs() < 1e-6);
        }
        // 20/m of absorption over 4 mm.
        let (reflected, passed) = plate(1.0, 1.0, 1.5, (-0.08f32).exp());
        assert!((passed - 0.851_905_5).abs() < 2e-6 && reflected + passed < 1.0);
    }

    /// Onto glass at 30 degrees of incidence: refracted to 19.4712 degrees (Snell).
    #[test]
    fn snells_law() {
        let mut at = Meetings { clear: [1.0; LANES], index: [1.5; LANES], pane: [-1.0; LANES], ..Meetings::default() };
        (at.part, at.range) = ([0.5; LANES], [7.0; LANES]);
        let (mut mirrored, mut refracted) = (Onward::default(), Onward::default());
        let cosine = 0.75f32.sqrt();
        let constant = |value: f32| [value; LANES];
        let (along, normal) = ([0.5, 0.0, -cosine].map(constant), [0.0, 0.0, 1.0].map(constant));
        let (along, normal) = (along.each_ref(), normal.each_ref());
        divide(&mut at, along, normal, normal, &[cosine; LANES], false, LANES, &mut mirrored, &mut refracted);
        for lane in [0, 31, 255] {
            let [down, up] = [&refracted, &mirrored].map(|on| on.direction.map(|axis| axis[lane]));
            assert!((down[0] - 0.333_333_3).abs() < 1e-6 && (down[2] + 0.942_809).abs() < 1e-6, "{down:?}");
            assert!((f64::from(down[0]).asin().to_degrees() - 19.4712).abs() < 5e-5);
            assert_eq!(up, [0.5, 0.0, cosine]);
            assert!((mirrored.part[lane] + refracted.part[lane] - 0.5).abs() < 1e-6);
            assert!(mirrored.origin[2][lane] > 0.0 && refracted.origin[2][lane] < 0.0);
            assert!((refracted.range[lane] - 7.0).abs() < 3e-5);
        }
    }

    /// Whatever the shading normal, reflected light stays on its side of the triangle, refracted light gets to the
    /// other, and each starts on its side.
    #[test]
    fn shading_normals_do_not_turn_light_through_the_triangle() {
        for (index, tilt) in [(1.5, 10.0), (1.5, 70.0), (1.0 / 1.5, 15.0), (1.0 / 1.5, 60.0)] {
            let tilts = |sign: f32| [sign * cos(90.0 - tilt), 0.0, cos(tilt)];
            for (down, normal) in [(60.0, tilts(1.0)), (85.0, tilts(1.0)), (89.9, tilts(-1.0)), (20.0, tilts(1.0))] {
                let along = [cos(90.0 - down), 0.0, -cos(down)];
                let met = -(along[0] * normal[0] + along[2] * normal[2]);
                if met <= 0.0 {
                    continue;
                }
                let mut at =
                    Meetings { clear: [1.0; LANES], index: [index; LANES], pane: [-1.0; LANES], ..Meetings::default() };
                at.part = [1.0; LANES];
                let (mut mirrored, mut refracted) = (Onward::default(), Onward::default());
                let [along, normal, facet] = [along, normal, [0.0, 0.0, 1.0]].map(|it| it.map(|value| [value; LANES]));
                let [along, normal, facet] = [&along, &normal, &facet].map(|it| it.each_ref());
                divide(&mut at, along, normal, facet, &[met; LANES], false, 1, &mut mirrored, &mut refracted);
                let case = format!("index {index}, normal {normal:?}", normal = normal.map(|it| it[0]));
                assert!(
                    mirrored.direction[2][0] > 0.0 && mirrored.origin[2][0] > 0.9e-5,
                    "{case}: {:?}",
                    mirrored.direction
                );
                assert!(mirrored.direction[2][0] < 1.0 && mirrored.part[0] > 0.0, "{case}");
                let length: f32 = mirrored.direction.iter().map(|axis| axis[0] * axis[0]).sum();
                assert!((length - 1.0).abs() < 1e-5, "{case}: {length}");
                if refracted.part[0] > 0.0 {
                    assert!(refracted.direction[2][0] < 0.0 && refracted.origin[2][0] < -0.9e-5, "{case}");
                }
            }
        }
    }
}
