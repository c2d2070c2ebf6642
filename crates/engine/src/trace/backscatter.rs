//! Acoustic backscatter of surfaces, prepared for one frequency.

use super::{Arrival, Surfaces};
use crate::medium::Sea;
use echocast_kernels::echo::{STEPS, between, step, within_step};
use ground::lanes::MEDIUM;
use ground::math::LOG2_PER_DB;
use model::material::{ByColor, Material, ReflectanceSource, Reflectances, Sound};
use std::sync::Arc;

/// Backscatter and reflection loss of every material and the sea surface.
pub struct Backscatter {
    /// `log2(s_b / sine of the grazing angle)` at the angles of the table, a run of `STEPS + 1` for each material, then
    /// the sea surface; where reflectance comes from an image, the law for reflectance 1.
    pub laws: Vec<f32>,
    /// Reflection loss at those angles, dB, likewise.
    losses: Vec<f32>,
    /// What else backscatter depends on, by material.
    by: Vec<By>,
    /// Where reflectances come from.
    source: ReflectanceSource,
    frequency: f64,
    sea: Sea,
    speed: f64,
}

/// What backscatter depends on in addition to the angle.
#[derive(Clone, Copy, PartialEq)]
enum By {
    /// Nothing.
    Law,
    /// The image of the surface: the law is for reflectance 1.
    Image(ByColor),
    /// The area of the object: the law is for 1 m^2.
    Area,
    /// Nothing; but the surface is smooth, and apart from its facets follows Lambert's law with this log2 of `mu`.
    Smooth(f32),
}

impl Backscatter {
    /// For `materials`, whose reflectances stand in where they have no acoustic properties, and for `sea`, at
    /// `frequency` Hz in water with a sound speed of `speed` m/s.
    pub fn new(
        materials: &[Arc<Material>],
        reflectances: &Reflectances,
        frequency: f64,
        sea: Sea,
        speed: f64,
    ) -> Backscatter {
        let mut laws = Vec::with_capacity((materials.len() + 1) * (STEPS + 1));
        let mut losses = Vec::with_capacity(laws.capacity());
        let mut by = Vec::with_capacity(materials.len());
        for ((material, &reflectance), &by_color) in
            materials.iter().zip(&reflectances.by_material).zip(&reflectances.by_color)
        {
            let of_reflectance = || Sound::of_reflectance(if reflectance.is_nan() { 1.0 } else { reflectance.into() });
            let known = material.sound_law();
            let sound = known.cloned().unwrap_or_else(of_reflectance);
            if let Some(strength) = sound.target_strength_db() {
                by.push(By::Area);
                // Averaged over directions, a convex body presents a quarter of its surface (Cauchy 1832): its target
                // strength is divided by this area to give the backscatter per area that is hit.
                tabulate(&mut laws, |_| strength / 10.0 * 10f64.log2() + 2.0);
            } else {
                by.push(if let Sound::Facet { mu_db, slope_sigma_deg: 0.0, .. } = sound {
                    By::Smooth(mu_db as f32 * LOG2_PER_DB)
                } else if known.is_none() && reflectance.is_nan() {
                    By::Image(by_color)
                } else {
                    By::Law
                });
                tabulate(&mut laws, |sine| (sound.backscatter(sine, frequency) / sine).max(1e-30).log2());
            }
            tabulate(&mut losses, |sine| sound.reflection_loss_db(sine));
        }
        tabulate(&mut laws, |sine| (sea.backscatter(sine, frequency) / sine).max(1e-30).log2());
        tabulate(&mut losses, |sine| sea.mirror_loss_db(sine, frequency, speed));
        Backscatter { laws, losses, by, source: reflectances.source, frequency, sea, speed }
    }

    /// Whether it is what [`Backscatter::new`] would make of the same surfaces.
    pub fn is_for(&self, source: ReflectanceSource, frequency: f64, sea: Sea, speed: f64) -> bool {
        (self.source, self.frequency, self.sea, self.speed) == (source, frequency, sea, speed)
    }

    /// Index in `laws` where the law of a row begins.
    pub fn law(&self, surfaces: &Surfaces, row: u32) -> u32 {
        (self.material(surfaces, row) * (STEPS + 1)) as u32
    }

    /// Log2 added to the law of the surface that an arrival hits, whatever the angle.
    pub fn constant_log2(&self, surfaces: &Surfaces, arrival: &Arrival) -> f32 {
        match self.by.get(self.material(surfaces, arrival.surface)) {
            None | Some(By::Law | By::Smooth(_)) => 0.0,
            Some(By::Area) => -surfaces.rows[arrival.surface as usize].area.max(1e-9).log2(),
            Some(By::Image(by_color)) => {
                let surface = &surfaces.rows[arrival.surface as usize];
                let rgba = surfaces.base_color(surface, arrival.triangle, arrival.corner);
                by_color.of(rgba).max(1e-9).log2()
            }
        }
    }

    /// `log2(s_b / sine)` of the surface that an arrival hits, at the sine of a grazing angle.
    pub fn log2(&self, surfaces: &Surfaces, arrival: &Arrival, sine: f32) -> f32 {
        interpolate(&self.laws, self.material(surfaces, arrival.surface), sine) + self.constant_log2(surfaces, arrival)
    }

    /// Backscatter of the surface that an arrival hits, at the sine of a grazing angle, dB per m^2.
    pub fn strength_db(&self, surfaces: &Surfaces, arrival: &Arrival, sine: f32) -> f64 {
        let ratio = self.log2(surfaces, arrival, sine) + sine.log2();
        f64::from(ratio) * 10.0 * std::f64::consts::LOG10_2
    }

    /// Whether a row scatters as a whole, from whichever side it is hit.
    pub fn is_whole(&self, surfaces: &Surfaces, row: u32) -> bool {
        self.by.get(self.material(surfaces, row)) == Some(&By::Area)
    }

    /// Whether a row has smooth facets, and what it scatters in addition to them: log2 of `mu` of Lambert's law.
    pub fn smooth(&self, surfaces: &Surfaces, row: u32) -> Option<f32> {
        match self.by.get(self.material(surfaces, row)) {
            Some(&By::Smooth(mu)) => Some(mu),
            _ => None,
        }
    }

    /// log2 of the target strength of a row that scatters as a whole, re 1 m^2.
    pub fn target_strength(&self, surfaces: &Surfaces, row: u32) -> f32 {
        // The law is per area that is hit, a quarter of 1 m^2.
        interpolate(&self.laws, self.material(surfaces, row), 1.0) - 2.0
    }

    /// Loss of a reflection by a row, or by the sea surface, at the sine of a grazing angle, dB.
    pub fn reflection_loss(&self, surfaces: &Surfaces, row: u32, sine: f64) -> f64 {
        interpolate(&self.losses, self.material(surfaces, row), sine as f32).into()
    }

    fn material(&self, surfaces: &Surfaces, row: u32) -> usize {
        if row == MEDIUM { self.by.len() } else { surfaces.rows[row as usize].material as usize }
    }
}

fn tabulate(table: &mut Vec<f32>, value: impl Fn(f64) -> f64) {
    table.extend((0..=STEPS).map(|step| {
        let part = step as f64 / STEPS as f64;
        value((1.0 - part * part).max(1e-3)) as f32
    }));
}

fn interpolate(table: &[f32], material: usize, sine: f32) -> f32 {
    let (whole, part) = within_step(step(sine));
    let first = material * (STEPS + 1) + whole;
    between(table[first], table[first + 1], part)
}
