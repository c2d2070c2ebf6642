//! The surfaces of a scene, with what is computed from them once.

use super::instances::Instances;
use super::radar::PartPlanes;
use super::{Backscatter, Surfaces};
use crate::medium::Sea;
use ground::kept::kept;
use model::material::{Mirrors, ReflectanceSource, Reflectances};
use std::ops::Deref;
use std::sync::{Arc, Mutex, OnceLock};

/// [`Surfaces`], shared by the snapshots of a scene until they change: a scan in a loop computes nothing again.
pub struct SharedSurfaces {
    table: Surfaces,
    /// Computed once for each wavelength.
    reflectances: Mutex<Vec<Arc<Reflectances>>>,
    /// Computed once for each frequency and sea.
    backscatter: Mutex<Vec<Arc<Backscatter>>>,
    /// Computed on first use.
    instances: OnceLock<Instances>,
    /// Likewise, for each part.
    planes: Vec<OnceLock<PartPlanes>>,
}

impl Deref for SharedSurfaces {
    type Target = Surfaces;

    fn deref(&self) -> &Surfaces {
        &self.table
    }
}

impl SharedSurfaces {
    pub(super) fn new(table: Surfaces) -> SharedSurfaces {
        let (reflectances, backscatter, instances) = Default::default();
        let planes = table.parts.iter().map(|_| OnceLock::new()).collect();
        SharedSurfaces { table, reflectances, backscatter, instances, planes }
    }

    /// The labelled instances.
    pub(super) fn instances(&self) -> &Instances {
        self.instances.get_or_init(|| Instances::new(&self.table))
    }

    /// The largest planes of a part, for radars.
    pub(super) fn planes(&self, part: u32) -> &PartPlanes {
        self.planes[part as usize].get_or_init(|| PartPlanes::new(&self.table.parts[part as usize]))
    }

    /// Reflectance of every material at `wavelength_nm`.
    pub fn reflectances(&self, wavelength_nm: f64, source: ReflectanceSource, mirrors: Mirrors) -> Arc<Reflectances> {
        kept(
            &self.reflectances,
            |known| known.are_for(wavelength_nm, source, mirrors),
            || Reflectances::new(&self.materials, wavelength_nm, source, mirrors),
        )
    }

    /// Acoustic backscatter of every material and the `sea` at `frequency` Hz in water with a sound speed of `speed`
    /// m/s; `reflectances` stand in for materials without acoustic properties.
    pub fn backscatter(&self, reflectances: &Reflectances, frequency: f64, sea: Sea, speed: f64) -> Arc<Backscatter> {
        // The dependence on the speed is weak, so one value serves those near it; which one must not depend on earlier
        // calls.
        const STEP: f64 = 1e-3;
        let speed = ((speed.ln() / STEP).round() * STEP).exp();
        kept(
            &self.backscatter,
            |known| known.is_for(reflectances.source, frequency, sea, speed),
            || Backscatter::new(&self.materials, reflectances, frequency, sea, speed),
        )
    }
}
