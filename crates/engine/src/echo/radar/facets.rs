//! Echoes of smooth facets by physical optics, directly and by way of mirrors.
//!
//! Facets up to several Fresnel zones wide are integrated as a whole where all of them is in sight, and divided where
//! something hides a part, until the parts are small against the Fresnel zone. Of larger ones, and of those that extend over
//! several cells of range, only the places count whose echoes do not cancel: the mirror image and the edges.

use super::echoes::{RadarEcho, RadarEchoes, RadarRoute};
use super::wave::{Scatterer, WaveField};
use crate::trace::{ImageTarget, Mirror, MirrorChain, RowFacets, Search, SightMemory, Sighted, Sightlines};
use glam::DVec3;
use num_complex::Complex64;
use radar::optics::{Ends, OutlinePart};

/// Widest facets that are divided, in radii of the first Fresnel zone.
const WIDE: f64 = 8.0;
/// Up to this width the integral over a facet takes no longer than its bounds.
const FLAT: f64 = 0.25;
/// Up to this width a facet is in sight if its middle is.
const NARROW: f64 = 1.0;
/// Width up to which the corners and the middle are looked at; of wider ones the middles of the edges, too.
const CORNERS: f64 = 4.0;
/// Width of the parts of facets that are partly hidden.
const PARTS: f64 = 0.7;
/// Most divisions of a facet by two.
const MOST_DIVISIONS: u8 = 8;
/// Amplitude over that which matters up to which facets are not divided.
const FAINT: f64 = 30.0;
/// Divisions of a facet that mirrors of its size illuminate in part, as in corners: always, and where it is partly in the
/// dark.
const CORNER_DIVISIONS: [u8; 2] = [2, 6];

/// A facet or a part of it.
#[derive(Clone, Copy)]
struct FacetPart {
    triangle: u32,
    corners: [DVec3; 3],
    divisions: u8,
    /// Width in Fresnel radii.
    width: f64,
    /// Whether the mirrors are small against the facet.
    in_corner: bool,
    /// Kirchhoff's integral over all of it, 1/m, if that is known.
    value: Option<Complex64>,
    /// Where its visibility is tested: first place and number.
    first: u32,
    places: u8,
}

/// What was found of a facet whose echo may matter.
struct FacetEcho {
    /// As [`FacetPart::width`] and [`FacetPart::value`].
    width: f64,
    value: Option<Complex64>,
}

/// Echo of a place on a large facet.
struct CriticalPlace {
    triangle: u32,
    value: Complex64,
    place: DVec3,
    first: u32,
    places: u8,
}

/// Buffers of [`scatter_from_facets`].
#[derive(Default)]
pub(crate) struct FacetMemory {
    sight: SightMemory,
    queue: Vec<FacetPart>,
    next: Vec<FacetPart>,
    critical: Vec<CriticalPlace>,
    places: Vec<DVec3>,
    there: Vec<Sighted>,
    back: Vec<Sighted>,
}

/// Adds the coherent echoes of one target to `echoes`; `spread` is the range resolution, m, within which the echoes of an
/// edge are joined.
pub(crate) fn scatter_from_facets(
    field: &WaveField,
    sightlines: &Sightlines,
    search: &Search,
    number: u32,
    spread: f64,
    memory: &mut FacetMemory,
    echoes: &mut RadarEchoes,
) {
    let target = &search.targets[number as usize];
    let mirrors = MirrorChain::new(field.place, target.mirrors.iter().map(|&mirror| search.mirrors[mirror]));
    let image = mirrors.image();
    let routes: &[(RadarRoute, Ends)] = &match mirrors.all().len() {
        0 => vec![(RadarRoute::Direct, Ends { source: field.place, observer: field.place })],
        1 => vec![
            (RadarRoute::Out, Ends { source: image, observer: field.place }),
            (RadarRoute::Both, Ends { source: image, observer: image }),
        ],
        _ => vec![(RadarRoute::Out, Ends { source: image, observer: field.place })],
    };
    let middle = search.rows[target.target].middle;
    let once = field.kept(target.mirrors.iter().map(|&mirror| search.mirrors[mirror]), image, middle);
    let greatest = field.gain_ahead();
    for &(route, ends) in routes {
        let kept = if route == RadarRoute::Both { once * once } else { once };
        FacetTask { field, sightlines, search, target, number, spread, mirrors, route, ends, kept, greatest }
            .run(memory, echoes);
    }
}

/// The facets of one target along one route.
struct FacetTask<'a> {
    field: &'a WaveField<'a>,
    sightlines: &'a Sightlines<'a>,
    search: &'a Search,
    target: &'a ImageTarget,
    number: u32,
    spread: f64,
    mirrors: MirrorChain,
    route: RadarRoute,
    ends: Ends,
    /// Part of the amplitude that mirrors leave, at most.
    kept: f64,
    /// Greatest gain of amplitudes, both ways.
    greatest: f64,
}

impl FacetTask<'_> {
    fn run(&self, memory: &mut FacetMemory, echoes: &mut RadarEchoes) {
        let row = self.search.rows[self.target.target];
        let facets = self.field.scene.row_facets(row, self.field.time);
        // Few images in mirrors return into one cell.
        let floor = if self.target.mirrors.is_empty() { self.field.floor } else { self.field.noise() };
        let floor = floor / (row.triangles as f64).sqrt().sqrt();
        memory.queue.clear();
        memory.critical.clear();
        memory.places.clear();
        for triangle in facets.triangles() {
            let corners = facets.corners(triangle);
            let Some((middle, cos)) = self.facing(&corners) else { continue };
            if !self.is_near_mirrors(&corners, middle) {
                continue;
            }
            let reflected = f64::from(self.field.surfaces.mirrored(&self.field.scene.surfaces, row.row, cos));
            let Some(FacetEcho { width, value }) = self.counts(&corners, middle, reflected, floor) else { continue };
            if self.route == RadarRoute::Both && self.is_mirrored(triangle) {
                // Found as a target behind two mirrors.
                continue;
            }
            if width <= WIDE {
                let in_corner = self.has_corner(&corners);
                let part = FacetPart { triangle, corners, divisions: 0, width, in_corner, value, first: 0, places: 0 };
                memory.queue.push(part);
            } else {
                self.add_critical(triangle, &corners, self.long_inner(&facets, triangle, &corners), floor, memory);
            }
        }
        self.emit_critical(memory, echoes);
        while !memory.queue.is_empty() {
            self.sweep(floor, memory, echoes);
        }
    }

    /// The middle of a facet, and the cosine of incidence as of a mirror that turns the wave there; `None`: source and
    /// observer are on different sides.
    fn facing(&self, [a, b, c]: &[DVec3; 3]) -> Option<(DVec3, f32)> {
        let middle = (a + b + c) / 3.0;
        let normal = (b - a).cross(c - a);
        let [to_source, to_observer] = [self.ends.source - middle, self.ends.observer - middle];
        let [up, down] = [normal.dot(to_source), normal.dot(to_observer)];
        if up * down <= 0.0 {
            return None;
        }
        let half = to_source.normalize() + to_observer.normalize();
        Some((middle, (0.5 * half.length()) as f32))
    }

    /// Whether the mirrors may be where a facet or a part of it appears in them.
    fn is_near_mirrors(&self, corners: &[DVec3; 3], middle: DVec3) -> bool {
        let Some(last) = self.mirrors.all().last() else { return true };
        let behind = last.height(self.mirrors.image());
        if corners.iter().all(|corner| last.height(*corner) * behind > 0.0) {
            return false;
        }
        let aside = longest(corners);
        // Of what one place does not see in them, another one may.
        let near = |place: &DVec3| self.mirrors.bends(*place).is_none_or(|bends| self.mirrors.hold(&bends, aside));
        near(&middle) || corners.iter().any(near)
    }

    /// A facet whose echo could matter, with its integral if it was needed to tell.
    fn counts(&self, corners: &[DVec3; 3], middle: DVec3, reflected: f64, floor: f64) -> Option<FacetEcho> {
        let [r, s] = [(middle - self.ends.source).length(), (middle - self.ends.observer).length()];
        let longest = longest(corners);
        if 0.5 * (r + s) - longest > self.field.reach {
            return None;
        }
        let scale = self.kept * reflected * self.field.scale();
        let strength = self.ends.bound(*corners, self.field.k());
        if strength * scale * self.greatest < floor {
            return None;
        }
        let out = (self.mirrors.target_image(middle) - self.field.place).normalize_or_zero().as_vec3();
        let back = if self.route == RadarRoute::Both {
            out
        } else {
            (middle - self.field.place).normalize_or_zero().as_vec3()
        };
        // Of a facet that is large for its distance, a part may be where the elements have gain.
        let gain = if longest > 0.3 * r.min(s) { self.greatest } else { self.field.gain(out, back) };
        let least = floor / (scale * gain);
        if strength < least {
            return None;
        }
        let width = longest / self.ends.fresnel(middle, self.field.k());
        let narrow = width <= WIDE;
        // What returns little as a whole returns no more in parts but for corners, where mirrors cut parts out.
        if narrow && strength > FAINT * least && self.has_corner(corners) {
            return Some(FacetEcho { width, value: None });
        }
        if width > FLAT && self.ends.edge_bound(*corners, self.field.k()) < least {
            return None;
        }
        if narrow && self.depth(corners) <= self.spread {
            let value = self.ends.facet(*corners, self.field.k());
            return (value.norm() > least).then_some(FacetEcho { width, value: Some(value) });
        }
        Some(FacetEcho { width, value: None })
    }

    /// By how much the ranges of the corners of a facet differ, m.
    fn depth(&self, corners: &[DVec3; 3]) -> f64 {
        let [a, b, c] = corners.map(|corner| 0.5 * self.ends.length(corner));
        a.max(b).max(c) - a.min(b).min(c)
    }

    /// Which edges of a wide facet another one of its plane continues that is as wide.
    fn long_inner(&self, facets: &RowFacets, triangle: u32, corners: &[DVec3; 3]) -> [bool; 3] {
        let mut inner = facets.inner(triangle);
        for (edge, inner) in inner.iter_mut().enumerate() {
            let [from, to] = [corners[edge], corners[(edge + 1) % 3]];
            let middle = 0.5 * (from + to);
            // Beyond doubt, wherever the middle of the other one is.
            *inner &= (to - from).length() > 1.5 * WIDE * self.ends.fresnel(middle, self.field.k());
        }
        inner
    }

    /// Whether a mirror beside a facet is so small that it illuminates a part of it.
    fn has_corner(&self, corners: &[DVec3; 3]) -> bool {
        let width = longest(corners);
        let beside = |mirror: &Mirror| {
            mirror.radius < 4.0 * width && (mirror.point - corners[0]).length() < 2.0 * mirror.radius + 4.0 * width
        };
        self.mirrors.all().iter().any(beside)
    }

    /// Whether the last mirror's waves are mirrored by the plane of a triangle, too.
    fn is_mirrored(&self, triangle: u32) -> bool {
        let Some(&last) = self.target.mirrors.last() else { return false };
        let own = self.search.mirror_of(self.field.scene, self.target.target, triangle);
        own.is_some_and(|own| self.search.is_mirrored(last, own, self.field.wavelength))
    }

    /// Adds the places of a large facet that count.
    fn add_critical(
        &self,
        triangle: u32,
        corners: &[DVec3; 3],
        inner: [bool; 3],
        floor: f64,
        memory: &mut FacetMemory,
    ) {
        let FacetMemory { critical, places, .. } = memory;
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let scale = self.field.scale();
        self.ends.each_piece(*corners, inner, self.field.k(), self.spread, &mut |part| {
            let first = places.len() as u32;
            let (OutlinePart::Mirror(value, place) | OutlinePart::Edge(value, place)) = part;
            let direction = (place - self.field.place).normalize_or_zero().as_vec3();
            if 0.5 * self.ends.length(place) > self.field.reach
                || value.norm() * self.kept * scale * self.field.gain(direction, direction) < floor
            {
                return;
            }
            match part {
                OutlinePart::Mirror(..) => {
                    // All of the Fresnel zone contributes.
                    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
                    let across = normal.any_orthonormal_vector() * (0.5 * self.ends.fresnel(place, self.field.k()));
                    let aside = normal.cross(across);
                    places.extend([place, place + across, place - across, place + aside, place - aside]);
                }
                // A little inside.
                OutlinePart::Edge(..) => places.push(place + 1e-3 * (middle - place).normalize_or_zero()),
            }
            critical.push(CriticalPlace { triangle, value, place, first, places: (places.len() as u32 - first) as u8 });
        });
    }

    fn emit_critical(&self, memory: &mut FacetMemory, echoes: &mut RadarEchoes) {
        if memory.critical.is_empty() {
            return;
        }
        self.look(memory);
        let FacetMemory { critical, there, .. } = memory;
        for it in critical.drain(..) {
            let sighted = &there[it.first as usize..][..usize::from(it.places)];
            if let Some(seen) = mean(sighted) {
                self.emit(it.triangle, it.place, it.value, &seen, echoes);
            }
        }
    }

    /// Takes all elements of the queue: in sight, they are integrated, partly hidden, divided.
    fn sweep(&self, floor: f64, memory: &mut FacetMemory, echoes: &mut RadarEchoes) {
        memory.places.clear();
        for element in &mut memory.queue {
            let [a, b, c] = element.corners;
            let middle = (a + b + c) / 3.0;
            element.first = memory.places.len() as u32;
            if element.width > NARROW || element.in_corner {
                // A little inside.
                let place = |place: DVec3| place.lerp(middle, 0.04);
                memory.places.extend([middle, place(a), place(b), place(c)]);
                if element.width > CORNERS {
                    memory.places.extend([0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)].map(place));
                }
            } else {
                memory.places.push(middle);
            }
            element.places = (memory.places.len() as u32 - element.first) as u8;
        }
        self.look(memory);
        let FacetMemory { queue, next, there, .. } = memory;
        let gain = self.greatest;
        next.clear();
        for element in queue.drain(..) {
            let sighted = &there[element.first as usize..][..usize::from(element.places)];
            let seen = sighted.iter().filter(|sighted| sighted.through > 0.0).count();
            let [always, most] = if element.in_corner { CORNER_DIVISIONS } else { [0, MOST_DIVISIONS] };
            // Whatever is weak is as weak in parts.
            let strong = |corners| {
                self.ends.edge_bound(corners, self.field.k()) * self.kept * self.field.scale() * gain > FAINT * floor
            };
            let wide = element.in_corner || (element.width > PARTS && sighted.len() > 1 && strong(element.corners));
            let mixed = seen > 0 && seen < sighted.len();
            if element.divisions < always || (mixed && wide && element.divisions < most) {
                divide(&element, next);
                continue;
            }
            let Some(seen) = mean(sighted) else { continue };
            // All parts of a facet together may matter as much as all of it.
            let floor = floor * 0.25f64.powi(element.divisions.into());
            if self.depth(&element.corners) > self.spread {
                self.emit_pieces(&element, &seen, floor, echoes);
                continue;
            }
            let value = element.value.unwrap_or_else(|| self.ends.facet(element.corners, self.field.k()));
            if value.norm() * self.field.scale() * f64::from(seen.through) * gain < floor {
                continue;
            }
            let middle = (element.corners[0] + element.corners[1] + element.corners[2]) / 3.0;
            self.emit(element.triangle, middle, value, &seen, echoes);
        }
        std::mem::swap(queue, next);
    }

    /// Adds the echoes of the edges of a part that extends over several cells of range.
    fn emit_pieces(&self, element: &FacetPart, seen: &Sighted, floor: f64, echoes: &mut RadarEchoes) {
        let scale = self.field.scale() * f64::from(seen.through) * self.greatest;
        self.ends.each_piece(element.corners, [false; 3], self.field.k(), self.spread, &mut |part| {
            let (OutlinePart::Mirror(value, place) | OutlinePart::Edge(value, place)) = part;
            if value.norm() * scale > floor {
                self.emit(element.triangle, place, value, seen, echoes);
            }
        });
    }

    /// Looks at `memory.places` along the route; `memory.there` gets what is in sight both ways.
    fn look(&self, memory: &mut FacetMemory) {
        let FacetMemory { sight, places, there, back, .. } = memory;
        self.sightlines.look(self.field.place, &self.mirrors, places, sight, there);
        if self.route == RadarRoute::Out {
            let direct = MirrorChain::new(self.field.place, std::iter::empty());
            self.sightlines.look(self.field.place, &direct, places, sight, back);
            there.iter_mut().zip(&*back).for_each(|(there, back)| there.through *= back.through);
        } else {
            there.iter_mut().for_each(|there| there.through *= there.through);
        }
    }

    /// Adds the echo of a place, and its reverse.
    fn emit(&self, triangle: u32, place: DVec3, strength: Complex64, seen: &Sighted, echoes: &mut RadarEchoes) {
        let row = self.search.rows[self.target.target];
        let velocity = self.field.scene.row_facets(row, self.field.time).velocity(triangle);
        let scattering = Scatterer { row: row.row, triangle, velocity, place, strength, incoherent: false };
        let echo = self.field.echo(&scattering, &self.mirrors, seen, self.route, self.number);
        let Some(echo) = echo.filter(|echo| echo.amplitude.norm_sqr() > 0.0) else { return };
        echoes.push(echo);
        // Waves to a mirror and back are found from its side.
        if self.route == RadarRoute::Out && !self.is_mirrored(triangle) {
            echoes.push(RadarEcho { tx: echo.rx, rx: echo.tx, route: RadarRoute::Back, ..echo });
        }
    }
}

/// The mean of what was `sighted`, with the mirrors of the first that was.
fn mean(sighted: &[Sighted]) -> Option<Sighted> {
    let first = sighted.iter().find(|sighted| sighted.through > 0.0)?;
    let sum: f32 = sighted.iter().map(|sighted| sighted.through).sum();
    Some(Sighted { through: sum / sighted.len() as f32, ..*first })
}

fn longest([a, b, c]: &[DVec3; 3]) -> f64 {
    (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared()).sqrt()
}

/// Divides an element into four of half its width.
fn divide(element: &FacetPart, parts: &mut Vec<FacetPart>) {
    let [a, b, c] = element.corners;
    let [x, y, z] = [0.5 * (b + c), 0.5 * (a + c), 0.5 * (a + b)];
    let divisions = element.divisions + 1;
    let part = |corners| FacetPart { corners, divisions, value: None, width: 0.5 * element.width, ..*element };
    parts.extend([[a, z, y], [z, b, x], [y, x, c], [x, y, z]].map(part));
}
