//! Meshes as Embree's structures.

use super::Engine;
use crate::trace::engine::embree_error;
use embree4::{Candidate, Coherence, CommittedScene, Pace, Packet, Quality};
use glam::{DAffine3, DVec3};
use ground::error::Result;
use model::Mesh;
use std::sync::PoisonError;

impl Engine {
    /// Builds what objects with `mesh` need to be traced, which otherwise happens when the first of them is committed.
    /// This can be done on any thread while scenes are edited, and leaves a core free for committing them.
    ///
    /// # Errors
    /// Embree's: out of memory.
    pub fn prepare(&self, mesh: &Mesh) -> Result<()> {
        structure_of(mesh, self, Pace::Aside).map(drop)
    }
}

/// What rays are traced through: what stands, then what moves, each in a scene of its own, whose geometry ids do not
/// overlap. In one scene Embree would search what moves first, and rays would look for it behind walls.
pub struct TracedScenes {
    standing: CommittedScene,
    /// `None`: nothing moves.
    moving: Option<CommittedScene>,
    /// Box at all times around what moves, if that is a single shape: Embree would not test its box, but call it for
    /// every ray.
    lone: Option<[[f32; 3]; 2]>,
}

impl TracedScenes {
    /// `moving` is a scene and how many shapes it has.
    pub fn new(standing: CommittedScene, moving: Option<(CommittedScene, usize)>) -> TracedScenes {
        let lone = moving.as_ref().and_then(|(scene, shapes)| (*shapes == 1).then(|| scene.bounds()));
        TracedScenes { standing, moving: moving.map(|(scene, _)| scene), lone }
    }

    /// What moves, and the lanes of `valid` whose rays may meet it; `None`: no ray does.
    #[inline]
    fn moving<const W: usize>(&self, valid: &[i32; W], rays: &Packet<W>) -> Option<(&CommittedScene, [i32; W])> {
        let moving = self.moving.as_ref()?;
        let lanes = match &self.lone {
            Some(around) => passing(valid, rays, around),
            // Rays that were blocked have ended.
            None => std::array::from_fn(|lane| if rays.tfar[lane] < 0.0 { 0 } else { valid[lane] }),
        };
        (lanes != [0; W]).then_some((moving, lanes))
    }

    /// Traces `rays` through what stands, and then through what moves those that may meet it.
    #[inline]
    fn each<const W: usize>(
        &self,
        valid: &[i32; W],
        rays: &mut Packet<W>,
        trace: impl Fn(&CommittedScene, &[i32; W], &mut Packet<W>),
    ) {
        trace(&self.standing, valid, rays);
        if let Some((moving, lanes)) = self.moving(valid, rays) {
            trace(moving, &lanes, rays);
        }
    }

    /// As [`CommittedScene::intersect`].
    #[inline]
    pub fn intersect<const W: usize>(&self, valid: &[i32; W], rays: &mut Packet<W>, coherence: Coherence) {
        self.each(valid, rays, |scene, valid, rays| scene.intersect(valid, rays, coherence));
    }

    /// As [`CommittedScene::intersect_where`].
    #[inline]
    pub fn intersect_where<const W: usize, F: Fn(&Candidate) -> bool>(
        &self,
        valid: &[i32; W],
        rays: &mut Packet<W>,
        coherence: Coherence,
        counts: &F,
    ) {
        self.each(valid, rays, |scene, valid, rays| scene.intersect_where(valid, rays, coherence, counts));
    }

    /// As [`CommittedScene::occlude`].
    #[inline]
    pub fn occlude<const W: usize>(&self, valid: &[i32; W], rays: &mut Packet<W>, coherence: Coherence) {
        self.each(valid, rays, |scene, valid, rays| scene.occlude(valid, rays, coherence));
    }

    /// As [`CommittedScene::occlude_where`].
    #[inline]
    pub fn occlude_where<const W: usize, F: Fn(&Candidate) -> bool>(
        &self,
        valid: &[i32; W],
        rays: &mut Packet<W>,
        coherence: Coherence,
        counts: &F,
    ) {
        self.each(valid, rays, |scene, valid, rays| scene.occlude_where(valid, rays, coherence, counts));
    }

    /// As [`CommittedScene::bounds`].
    pub fn bounds(&self) -> [[f32; 3]; 2] {
        let [low, high] = self.standing.bounds();
        let Some([least, most]) = self.moving.as_ref().map(CommittedScene::bounds) else { return [low, high] };
        let ends = |of: fn(f32, f32) -> f32, a: [f32; 3], b: [f32; 3]| std::array::from_fn(|axis| of(a[axis], b[axis]));
        [ends(f32::min, low, least), ends(f32::max, high, most)]
    }
}

/// The lanes of `valid` whose rays pass through a box before they end.
#[inline]
fn passing<const W: usize>(valid: &[i32; W], rays: &Packet<W>, [low, high]: &[[f32; 3]; 2]) -> [i32; W] {
    /// More than the rounding of a way to the box.
    const WIDER: f32 = 1.0 + 8.0 * f32::EPSILON;
    let (mut near, mut far) = (rays.tnear, rays.tfar);
    let axes = [(&rays.org_x, &rays.dir_x), (&rays.org_y, &rays.dir_y), (&rays.org_z, &rays.dir_z)];
    for (axis, (org, dir)) in axes.into_iter().enumerate() {
        for lane in 0..W {
            let per = 1.0 / dir[lane];
            let (a, b) = ((low[axis] - org[lane]) * per, (high[axis] - org[lane]) * per);
            // Comparisons are single instructions, `f32::min` is not.
            let (first, last) = (if a < b { a } else { b }, if a > b { a } else { b });
            near[lane] = if first > near[lane] { first } else { near[lane] };
            far[lane] = if last < far[lane] { last } else { far[lane] };
        }
    }
    std::array::from_fn(|lane| if near[lane] <= far[lane] * WIDER { valid[lane] } else { 0 })
}

/// The ray-tracing structure of `mesh`, built now if the engine does not have it yet.
pub(super) fn structure_of(mesh: &Mesh, engine: &Engine, pace: Pace) -> Result<CommittedScene> {
    let mut built = mesh.structure.built.lock().unwrap_or_else(PoisonError::into_inner);
    let known = built.as_ref().and_then(|known| known.downcast_ref::<CommittedScene>());
    if let Some(scene) = known.filter(|scene| scene.is_of(engine.device())) {
        return Ok(scene.clone());
    }
    let quality = if mesh.structure.changing { Quality::Low } else { Quality::Medium };
    let scene = mesh_scene(engine, mesh, quality, None, pace)?;
    *built = Some(Box::new(scene.clone()));
    Ok(scene)
}

/// The structure of `mesh`, whose vertices are moved by `transform`.
pub(super) fn mesh_scene(
    engine: &Engine,
    mesh: &Mesh,
    quality: Quality,
    transform: Option<&DAffine3>,
    pace: Pace,
) -> Result<CommittedScene> {
    let mut scene = embree4::Scene::new(engine.device(), quality).map_err(embree_error)?;
    attach(&mut scene, engine, mesh, u32::MAX, transform)?;
    engine.commit(scene, mesh.triangle_count(), pace)
}

/// Adds the parts of `mesh` to `scene`, one geometry each.
pub(super) fn attach(
    scene: &mut embree4::Scene,
    engine: &Engine,
    mesh: &Mesh,
    mask: u32,
    transform: Option<&DAffine3>,
) -> Result<()> {
    for part in &mesh.parts {
        let device = engine.device();
        let triangles = &part.triangles;
        let mesh = match transform {
            None => {
                embree4::Mesh::new(device, part.positions.iter().copied(), triangles, mask).map_err(embree_error)?
            }
            Some(transform) => {
                let positions = part
                    .positions
                    .iter()
                    .map(|p| transform.transform_point3(DVec3::from(p.map(f64::from))).as_vec3().to_array());
                embree4::Mesh::new(device, positions, triangles, mask).map_err(embree_error)?
            }
        };
        scene.attach_mesh(&mesh).map_err(embree_error)?;
    }
    Ok(())
}

/// A transform in Embree's form: column by column, single precision.
pub(super) fn columns(m: &DAffine3) -> [f32; 12] {
    let columns = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis, m.translation];
    std::array::from_fn(|k| columns[k / 3][k % 3] as f32)
}
