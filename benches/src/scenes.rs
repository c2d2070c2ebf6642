//! The scenes of the benchmark, made by formula so that every machine has the same.

use echocast::scene::{Labels, Material, Mesh, NameTable, Object, Part, Scene};
use glam::{DAffine3, DVec3, Vec3};
use std::path::Path;
use std::sync::{Arc, LazyLock};

/// Random numbers for shapes: any generator will do, as long as it is the same everywhere (xorshift64*).
pub struct Shapes(u64);

impl Shapes {
    pub fn new(seed: u64) -> Self {
        Shapes(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    /// In [low, high).
    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let bits = (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 40) as f32;
        low + (high - low) * bits / (1u32 << 24) as f32
    }
}

/// Triangles under construction.
#[derive(Default)]
pub struct Builder {
    pub positions: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
}

impl Builder {
    pub fn quad(&mut self, corners: [[f32; 3]; 4]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }

    pub fn cuboid(&mut self, low: [f32; 3], high: [f32; 3]) {
        let corner = |i: u32| std::array::from_fn(|axis| if i >> axis & 1 == 0 { low[axis] } else { high[axis] });
        for face in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
            self.quad(face.map(corner));
        }
    }

    pub fn mesh(self, name: &str) -> Mesh {
        self.mesh_of(name, grey())
    }

    pub fn mesh_of(self, name: &str, material: Arc<Material>) -> Mesh {
        let part = Part {
            positions: self.positions.into(),
            triangles: self.triangles.into(),
            material: Some(material),
            ..Part::default()
        };
        Mesh::new(name, vec![part]).expect("sound parts")
    }
}

fn grey() -> Arc<Material> {
    static GREY: LazyLock<Arc<Material>> = LazyLock::new(|| {
        Arc::new(Material { name: "grey".into(), base_color: [0.5, 0.5, 0.5, 1.0], ..Material::default() })
    });
    GREY.clone()
}

fn scene(meshes: Vec<Mesh>, placed: Vec<(usize, DAffine3)>) -> Scene {
    let meshes: Vec<Arc<Mesh>> = meshes.into_iter().map(Arc::new).collect();
    let objects = placed
        .into_iter()
        .enumerate()
        .map(|(index, (mesh, world_from_object))| Object {
            world_from_object,
            category_id: mesh as u32 + 1,
            part_ids: vec![1; meshes[mesh].parts.len()],
            instance_id: index as u32 + 1,
            ..Object::new(format!("{}_{index}", meshes[mesh].name), meshes[mesh].clone())
        })
        .collect();
    let category = NameTable {
        ids: (1..=meshes.len() as u32).collect(),
        names: meshes.iter().map(|mesh| mesh.name.clone()).collect(),
    };
    Scene { objects, materials: vec![grey()], labels: Labels { category, ..Labels::default() }, ..Scene::default() }
}

/// One square of 2000 m at 10 m before the sensor (x forward), for the widest camera.
pub fn quad() -> Scene {
    let mut wall = Builder::default();
    wall.quad([[10.0, -1000.0, -1000.0], [10.0, 1000.0, -1000.0], [10.0, 1000.0, 1000.0], [10.0, -1000.0, 1000.0]]);
    scene(vec![wall.mesh("wall")], vec![(0, DAffine3::IDENTITY)])
}

/// A city: 15,000 boxes of 12 triangles in blocks around a crossing at the origin, on a ground plane.
pub fn city() -> Scene {
    let mut shapes = Shapes::new(1);
    let mut houses = Builder::default();
    const SIDE: i32 = 61;
    for row in -SIDE..=SIDE {
        for column in -SIDE..=SIDE {
            // Streets of 12 m every fourth lot, and along the axes.
            if row.rem_euclid(8) == 0 || column.rem_euclid(8) == 0 || houses.triangles.len() >= 180_000 {
                continue;
            }
            let (x, y) = (row as f32 * 9.0, column as f32 * 9.0);
            let height = shapes.between(4.0, 40.0);
            let half = [shapes.between(3.0, 4.4), shapes.between(3.0, 4.4)];
            houses.cuboid([x - half[0], y - half[1], 0.0], [x + half[0], y + half[1], height]);
            if houses.triangles.len() < 180_000 {
                houses.cuboid([x - 1.0, y - 1.0, height], [x + 1.0, y + 1.0, height + shapes.between(1.0, 4.0)]);
            }
        }
    }
    let mut ground = Builder::default();
    let far = 2000.0;
    ground.quad([[-far, -far, 0.0], [far, -far, 0.0], [far, far, 0.0], [-far, far, 0.0]]);
    scene(vec![ground.mesh("ground"), houses.mesh("building")], vec![(0, DAffine3::IDENTITY), (1, DAffine3::IDENTITY)])
}

fn leaves(tree: &mut Builder, shapes: &mut Shapes, at: [f32; 3], count: usize, size: f32) {
    for _ in 0..count {
        // A ball of random small triangles: the crown.
        let p = loop {
            let p: [f32; 3] = std::array::from_fn(|_| shapes.between(-1.0, 1.0));
            if p.iter().map(|c| c * c).sum::<f32>() <= 1.0 {
                break p;
            }
        };
        let centre = Vec3::new(at[0] + 2.0 * p[0], at[1] + 2.0 * p[1], at[2] + 4.5 + 2.0 * p[2]);
        let first = tree.positions.len() as u32;
        for _ in 0..3 {
            let offset =
                Vec3::new(shapes.between(-size, size), shapes.between(-size, size), shapes.between(-size, size));
            tree.positions.push((centre + offset).to_array());
        }
        tree.triangles.push([first, first + 1, first + 2]);
    }
}

/// Hills of 245,000 triangles with 550 trees of 100 leaves, 500 m wide.
pub fn terrain() -> Scene {
    let mut shapes = Shapes::new(2);
    let height = |x: f32, y: f32| {
        6.0 * (x / 40.0).sin() * (y / 55.0).cos()
            + 1.2 * (x / 9.0 + y / 13.0).sin()
            + 0.15 * (x * 1.1).sin() * (y * 1.3).cos()
            - 6.0 * (-(x * x + y * y) / 900.0).exp()
    };
    const CELLS: u32 = 350;
    let mut ground = Builder::default();
    for row in 0..=CELLS {
        for column in 0..=CELLS {
            let (x, y) = (column as f32 / CELLS as f32 * 500.0 - 250.0, row as f32 / CELLS as f32 * 500.0 - 250.0);
            ground.positions.push([x, y, height(x, y)]);
        }
    }
    for row in 0..CELLS {
        for column in 0..CELLS {
            let a = row * (CELLS + 1) + column;
            let (b, c, d) = (a + 1, a + CELLS + 1, a + CELLS + 2);
            ground.triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    let mut trees = Builder::default();
    for _ in 0..550 {
        let (x, y) = (shapes.between(-240.0, 240.0), shapes.between(-240.0, 240.0));
        let z = height(x, y);
        trees.cuboid([x - 0.2, y - 0.2, z - 0.5], [x + 0.2, y + 0.2, z + 3.0]);
        leaves(&mut trees, &mut shapes, [x, y, z], 88, 0.35);
    }
    scene(vec![ground.mesh("ground"), trees.mesh("vegetation")], vec![(0, DAffine3::IDENTITY), (1, DAffine3::IDENTITY)])
}

/// 10,000 instances of one tree of 10,000 triangles, 5 m apart, on a plane.
pub fn forest() -> Scene {
    let mut shapes = Shapes::new(3);
    let mut tree = Builder::default();
    tree.cuboid([-0.2, -0.2, 0.0], [0.2, 0.2, 3.0]);
    leaves(&mut tree, &mut shapes, [0.0; 3], 9_988, 0.06);
    let mut ground = Builder::default();
    ground.quad([[-300.0, -300.0, 0.0], [300.0, -300.0, 0.0], [300.0, 300.0, 0.0], [-300.0, 300.0, 0.0]]);
    let mut placed = vec![(0, DAffine3::IDENTITY)];
    for row in 0..100 {
        for column in 0..100 {
            let jitter = |shapes: &mut Shapes| f64::from(shapes.between(-1.2, 1.2));
            let at = DVec3::new(
                f64::from(column) * 5.0 - 247.5 + jitter(&mut shapes),
                f64::from(row) * 5.0 - 247.5 + jitter(&mut shapes),
                0.0,
            );
            let turn = glam::DQuat::from_rotation_z(f64::from(shapes.between(0.0, std::f32::consts::TAU)));
            let size = DVec3::splat(f64::from(shapes.between(0.7, 1.3)));
            placed.push((1, DAffine3::from_scale_rotation_translation(size, turn, at)));
        }
    }
    scene(vec![ground.mesh("ground"), tree.mesh("tree")], placed)
}

/// A flat of 11,000 triangles that ships with the repository.
pub fn flat() -> echocast::Result<Scene> {
    Scene::load(Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/scenes/apartment.glb"))
}

/// The paper's 5.2.2: a square that fills a view of 90 degrees, cut into `4^level` objects.
pub fn tiles(level: u32) -> Scene {
    let side = 1u32 << level;
    let step = 20.0 / side as f32;
    let mut meshes = Vec::new();
    let mut placed = Vec::new();
    for row in 0..side {
        for column in 0..side {
            let (y, z) = (column as f32 * step - 10.0, row as f32 * step - 10.0);
            let mut tile = Builder::default();
            tile.quad([[10.0, y, z], [10.0, y + step, z], [10.0, y + step, z + step], [10.0, y, z + step]]);
            placed.push((meshes.len(), DAffine3::IDENTITY));
            meshes.push(tile.mesh("tile"));
        }
    }
    scene(meshes, placed)
}

/// A height field of 1 M triangles, for readers.
pub fn million() -> Scene {
    let mut ground = Builder::default();
    const CELLS: u32 = 707;
    for row in 0..=CELLS {
        for column in 0..=CELLS {
            let (x, y) = (column as f32 * 0.7, row as f32 * 0.7);
            ground.positions.push([x, y, (x / 7.0).sin() + (y / 5.0).cos()]);
        }
    }
    for row in 0..CELLS {
        for column in 0..CELLS {
            let a = row * (CELLS + 1) + column;
            let (b, c, d) = (a + 1, a + CELLS + 1, a + CELLS + 2);
            ground.triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    scene(vec![ground.mesh("ground")], vec![(0, DAffine3::IDENTITY)])
}
