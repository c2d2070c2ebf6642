//! The meshes of trees, bushes, grass and rocks, and their instances.

use super::sites::{PATCH, ROCKS, Site, Sites, TUFTS, VARIANTS};
use super::species::{BUSH, Species, TREES};
use super::tree::{self, Plant};
use super::{Land, material};
use crate::glb::{Glb, Look, Placement, Primitive};
use crate::noise::Dice;
use crate::shapes::ClosedShape;
use glam::{DQuat, DVec3};
use ground::rng::Draw;
use std::f64::consts::TAU;

pub(super) fn add(glb: &mut Glb, land: &Land, sites: &Sites, seed: u64) {
    let ground = |site: &Site| site.at.extend(land.terrain.height(site.at.x, site.at.y));
    let upright = |site: &Site| Placement {
        at: ground(site),
        turned: DQuat::from_rotation_z(site.turn),
        scale: DVec3::splat(site.size),
    };
    for (kind, species) in TREES.iter().enumerate() {
        let of_kind: Vec<Site> = sites.trees.iter().filter(|site| site.kind == kind).copied().collect();
        woody(glb, species, "tree", kind, &of_kind, upright, seed);
    }
    woody(glb, &BUSH, "bush", TREES.len(), &sites.bushes, upright, seed);

    let lying = |site: &Site| {
        let normal = land.terrain.normal(site.at.x, site.at.y, 2.0 * PATCH);
        let lie = DQuat::from_rotation_arc(DVec3::Z, normal);
        let turned = (lie * DQuat::from_rotation_z(site.turn)).normalize();
        Placement { at: ground(site), turned, scale: DVec3::splat(site.size) }
    };
    let mut blades = None;
    for variant in 0..VARIANTS {
        let Some(places) = places(&sites.grass, variant, lying) else { continue };
        let color = || material(glb, "grass", Look::Sheet, [0.09, 0.17, 0.035], 0.5);
        let material = *blades.get_or_insert_with(color);
        let (vertices, triangles) = patch(&mut dice(seed, TREES.len() + 1, variant));
        let part = Primitive { triangles: &triangles, material };
        let name = format!("Grass_{}", variant + 1);
        let mesh = glb.mesh(&name, &single(&vertices), None, &[part]);
        let node = glb.objects(&name, "grass", mesh, &places);
        glb.root(node);
    }

    let mut stone = None;
    for variant in 0..ROCKS {
        let rock = ClosedShape::rock(&mut Dice::new(seed, Draw::Stone, 1 + variant as u32));
        let flat = 0.6 + 0.05 * variant as f64;
        let lying = |site: &Site| {
            let normal = land.terrain.normal(site.at.x, site.at.y, site.size);
            let lie = DQuat::from_rotation_arc(DVec3::Z, normal);
            let scale = DVec3::new(1.0, 0.85, flat) * (site.size / 2.0);
            // Its middle is a little above the ground, so that more than a third of it is below.
            let at = ground(site) + DVec3::Z * (0.2 * scale.z);
            Placement { at, turned: (lie * DQuat::from_rotation_z(site.turn)).normalize(), scale }
        };
        let Some(places) = places(&sites.rocks, variant, lying) else { continue };
        let material = *stone.get_or_insert_with(|| material(glb, "rock", Look::Matt, [0.22, 0.215, 0.2], 0.3));
        let part = Primitive { triangles: &rock.triangles, material };
        let name = format!("Rock_{}", variant + 1);
        let mesh = glb.mesh(&name, &rock.positions(), None, &[part]);
        let node = glb.objects(&name, "rock", mesh, &places);
        glb.root(node);
    }
}

/// Random numbers of the shape of a plant.
fn dice(seed: u64, kind: usize, variant: usize) -> Dice {
    Dice::new(seed, Draw::Plant, (kind * VARIANTS + variant) as u32)
}

/// A tree or bush as it grows from a seed.
pub(super) fn shape(species: &Species, kind: usize, variant: usize, seed: u64) -> Plant {
    tree::grow(species, &mut dice(seed, kind, variant))
}

/// The placements of the objects that share a mesh; `None` if there are none.
fn places(sites: &[Site], variant: usize, place: impl Fn(&Site) -> Placement) -> Option<Vec<Placement>> {
    let places: Vec<Placement> = sites.iter().filter(|site| site.variant == variant).map(place).collect();
    (!places.is_empty()).then_some(places)
}

fn woody(
    glb: &mut Glb,
    species: &Species,
    category: &'static str,
    kind: usize,
    sites: &[Site],
    place: impl Fn(&Site) -> Placement,
    seed: u64,
) {
    /// Names of the parts, and whether they are sheets.
    const PARTS: [(&str, Look); 3] = [("trunk", Look::Matt), ("branch", Look::Matt), ("leaf", Look::Sheet)];
    let mut materials = None;
    for variant in 0..VARIANTS {
        let Some(places) = places(sites, variant, &place) else { continue };
        let plant = shape(species, kind, variant, seed);
        let materials = *materials.get_or_insert_with(|| {
            std::array::from_fn::<usize, 3, _>(|part| {
                let ((name, look), (color, reflectance)) = (PARTS[part], species.colors[part]);
                if plant.parts[part].is_empty() { 0 } else { material(glb, name, look, color, reflectance) }
            })
        });
        let parts: [Primitive; 3] =
            std::array::from_fn(|part| Primitive { triangles: &plant.parts[part], material: materials[part] });
        let name = format!("{}_{}", species.name, variant + 1);
        let mesh = glb.mesh(&name, &single(&plant.vertices), Some(&single(&plant.normals)), &parts);
        let node = glb.objects(&name, category, mesh, &places);
        glb.root(node);
    }
}

fn single(vectors: &[DVec3]) -> Vec<[f32; 3]> {
    vectors.iter().map(|vector| vector.as_vec3().to_array()).collect()
}

/// A patch of grass about the origin: tufts of blades with three triangles each.
fn patch(dice: &mut Dice) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    const BLADES: usize = 7;
    /// Depth to which blades reach into the ground, which is not as flat as the patch, m.
    const ROOT: f64 = 0.06;
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for _ in 0..TUFTS {
        let (sin, cos) = dice.between(0.0, TAU).sin_cos();
        let tuft = DVec3::new(cos, sin, 0.0) * (PATCH * dice.unit().sqrt());
        let tall = dice.between(0.12, 0.32);
        for _ in 0..BLADES {
            let (sin, cos) = dice.between(0.0, TAU).sin_cos();
            let out = DVec3::new(cos, sin, 0.0);
            let side = DVec3::new(-sin, cos, 0.0) * dice.between(0.003, 0.006);
            let foot = tuft + out * dice.between(0.0, 0.04);
            let (height, lean) = (tall * dice.between(0.6, 1.1), dice.between(0.1, 0.6));
            let bend = foot + (DVec3::Z + out * (0.4 * lean)) * (0.55 * height);
            let tip = foot + DVec3::Z * (height * (1.0 - 0.35 * lean)) + out * (lean * height);
            let root = foot - DVec3::Z * ROOT;
            let first = vertices.len() as u32;
            vertices.extend([root - side, root + side, bend + side, bend - side, tip]);
            let blade = [[0, 1, 2], [0, 2, 3], [3, 2, 4]];
            triangles.extend(blade.map(|corners: [u32; 3]| corners.map(|corner| first + corner)));
        }
    }
    (vertices, triangles)
}
