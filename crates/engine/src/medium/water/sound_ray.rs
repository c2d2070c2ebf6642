//! A single sound ray through water, event by event, for comparison with other programs.

use super::{End, RefractedRay, Slab, Water, WaterColumn, slab_at};
use ground::error::Result;
use ground::read::bounds::{ABOVE_ZERO, Bounds};

/// A ray of sound between the surface of the water and a flat bottom, both of which reflect it.
#[derive(Clone, Debug)]
pub struct SoundRay {
    /// The column down to the bottom.
    slabs: Vec<Slab>,
    bottom: f64,
    ray: RefractedRay,
    start_speed: f64,
    wavelength: f64,
}

/// Position and state of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RayPoint {
    /// Horizontal distance from the start, m.
    pub distance_m: f64,
    /// Depth below the surface, m.
    pub depth_m: f64,
    /// Angle from the horizontal, rad, positive down.
    pub grazing: f64,
    /// Sound speed there, m/s.
    pub speed_m_s: f64,
    /// Time since the start, s.
    pub time_s: f64,
    /// Path length since the start, m.
    pub path_m: f64,
    /// Loss by absorption and at boundaries since the start, dB.
    pub loss_db: f64,
    /// Transmission loss by spreading since the start, dB re 1 m, 0 or more, from the tube between this ray and its
    /// neighbours; where they cross, diffraction limits the width of the tube to `sqrt(wavelength x path)`.
    pub spreading_db: f64,
}

/// What happens to a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum RayEvent {
    /// It passes into another layer of water; with the part of the energy transmitted, 0 to 1 (the paper's eq. 13).
    Boundary(f64),
    /// A layer reflects all of it.
    TotalReflection,
    /// The surface reflects it.
    Surface,
    /// The bottom reflects it.
    Bottom,
}

impl SoundRay {
    /// A ray through `water`, for sound of `frequency_hz`, from `depth_m` in the direction `grazing_deg` from the
    /// horizontal (positive down), over a bottom at `bottom_m`.
    ///
    /// # Errors
    /// A start above the water, below the bottom or outside the profile; an angle beyond 90 degrees.
    pub fn new(water: &Water, frequency_hz: f64, depth_m: f64, grazing_deg: f64, bottom_m: f64) -> Result<SoundRay> {
        let bounds = &mut Bounds::none();
        water.check("water", bounds)?;
        bounds.within("grazing_deg", grazing_deg, -90.0, 90.0)?;
        bounds.within("frequency_hz", frequency_hz, 1.0, 1e8)?;
        bounds.number("bottom_m", bottom_m, [ABOVE_ZERO, 1e6], "above 0, at most 1000000")?;
        bounds.within("depth_m", depth_m, 0.0, bottom_m)?;
        let (column, _) = WaterColumn::new(water, frequency_hz, depth_m)?;
        let mut slabs: Vec<Slab> = column.slabs.into_iter().filter(|slab| slab.top < bottom_m).collect();
        if let Some(last) = slabs.last_mut() {
            last.bottom = last.bottom.min(bottom_m);
        }
        let slab = slab_at(&slabs, depth_m);
        let (sine, cosine) = grazing_deg.to_radians().sin_cos();
        let ray = RefractedRay::launch(depth_m, [sine, cosine], &slabs, slab);
        let wavelength = ray.speed / frequency_hz;
        Ok(SoundRay { bottom: bottom_m, start_speed: ray.speed, wavelength, slabs, ray })
    }

    /// Its state at its start, or at its last event, before the event takes effect.
    pub fn point(&self) -> RayPoint {
        self.point_of(&self.ray)
    }

    /// Follows the ray to the next event; returns its state just before and the event. `None`: the ray goes on for
    /// ever, or so flat that it makes no progress.
    pub fn next_event(&mut self) -> Option<(RayPoint, RayEvent)> {
        /// Most slabs passed without an event.
        const MOST: usize = 100_000;
        for _ in 0..MOST {
            let (before, event) = self.pass()?;
            if let Some(event) = event {
                return Some((self.point_of(&before), event));
            }
        }
        None
    }

    /// Follows the ray to the end of its slab and beyond; returns its state just before and the event, if any. `None`:
    /// the ray goes on for ever, or along the surface or the bottom.
    fn pass(&mut self) -> Option<(RefractedRay, Option<RayEvent>)> {
        let slab = &self.slabs[self.ray.slab];
        let (length, end) = self.ray.exit(slab);
        if !length.is_finite() || end == End::Inside {
            return None;
        }
        self.ray = self.ray.advanced(slab, length);
        let edge = match end {
            End::Top if self.ray.slab == 0 => Some((0.0, -1.0, RayEvent::Surface)),
            End::Bottom if self.ray.slab == self.slabs.len() - 1 => Some((self.bottom, 1.0, RayEvent::Bottom)),
            _ => None,
        };
        if let Some((depth, down, event)) = edge {
            (self.ray.depth, self.ray.sine) = (depth, down * self.ray.sine.abs());
            let before = self.ray;
            self.ray.mirror(slab);
            let moves = length > 0.0 || before.sine != 0.0;
            return moves.then_some((before, Some(event)));
        }
        let before = self.ray;
        let event = match self.ray.cross(&self.slabs, end) {
            // At most the gradient changes.
            None => None,
            Some(_) if self.ray.slab == before.slab => Some(RayEvent::TotalReflection),
            Some(part) => Some(RayEvent::Boundary(part)),
        };
        Some((before, event))
    }

    /// Its state at the horizontal `distance_m`; `None`: it does not get there before the next change of slab.
    pub fn point_at(&self, distance_m: f64) -> Option<RayPoint> {
        let slab = &self.slabs[self.ray.slab];
        let (length, _) = self.ray.exit(slab);
        // A level ray in water without gradient goes on for ever.
        let length = length.min(2.0 * (distance_m - self.ray.distance).abs() + 1e6);
        let at = |length: f64| self.ray.advanced(slab, length);
        if distance_m < self.ray.distance || at(length).distance < distance_m {
            return None;
        }
        // Distance rises with the length.
        let (mut low, mut high) = (0.0, length);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if at(middle).distance < distance_m { low = middle } else { high = middle }
        }
        Some(self.point_of(&at(0.5 * (low + high))))
    }

    /// Moves on to the next slab or event, whichever comes first.
    pub fn next_slab(&mut self) -> Option<()> {
        self.pass().map(|_| ())
    }

    fn point_of(&self, ray: &RefractedRay) -> RayPoint {
        // Pressure: intensity by the tube's cross-section, and the impedance there over that at the start.
        let across = ray.speed_path / self.start_speed;
        let tube = ray.tube.abs().max((self.wavelength * ray.path).sqrt().min(ray.path));
        let spreading = (tube * across * self.start_speed / ray.speed).max(1.0);
        RayPoint {
            distance_m: ray.distance,
            depth_m: ray.depth,
            grazing: ray.sine.atan2(ray.snell * ray.speed),
            speed_m_s: ray.speed,
            time_s: ray.time,
            path_m: ray.path,
            loss_db: ray.loss(),
            spreading_db: 10.0 * spreading.log10(),
        }
    }
}
