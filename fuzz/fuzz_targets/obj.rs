//! OBJ and MTL files: any bytes give an error or a scene that keeps its promises.
//!
//! What follows the first NUL byte is the file `m.mtl` beside the scene.
//! `cargo fuzz run -s none obj fuzz/corpus/obj fuzz/seeds/obj -- -dict=fuzz/obj.dict`
#![no_main]

use echocast::Scene;
use libfuzzer_sys::fuzz_target;
use std::cell::OnceCell;
use std::fs;

thread_local! {
    static FOLDER: OnceCell<tempfile::TempDir> = const { OnceCell::new() };
}

fuzz_target!(|data: &[u8]| {
    FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| tempfile::tempdir().expect("a folder for the files")).path();
        let mut files = data.splitn(2, |&byte| byte == 0);
        fs::write(folder.join("scene.obj"), files.next().unwrap_or_default()).expect("the file can be written");
        fs::write(folder.join("m.mtl"), files.next().unwrap_or_default()).expect("the file can be written");
        if let Ok(scene) = Scene::load(folder.join("scene.obj")) {
            check(&scene);
        }
    });
});

fn check(scene: &Scene) {
    for mesh in &scene.meshes {
        assert!(!mesh.parts.is_empty());
        for part in &mesh.parts {
            let vertices = part.positions.len();
            assert!(!part.triangles.is_empty());
            assert!(part.positions.iter().flatten().all(|x| x.is_finite()));
            assert!(part.triangles.iter().flatten().all(|&index| (index as usize) < vertices));
            assert!(
                part.triangles.iter().all(|t| t.map(|i| part.positions[i as usize]).windows(2).all(|p| p[0] != p[1]))
            );
            if let Some(normals) = &part.normals {
                assert_eq!(normals.len(), vertices);
                let length = |n: &[f32; 3]| n.iter().map(|x| x * x).sum::<f32>();
                assert!(normals.iter().all(|normal| (length(normal) - 1.0).abs() < 1e-5));
            }
            assert!(
                part.uvs
                    .as_ref()
                    .is_none_or(|uvs| uvs.len() == vertices && uvs.iter().flatten().all(|x| x.is_finite()))
            );
            assert!(part.material.is_none_or(|index| index < scene.materials.len()));
        }
    }
    for material in &scene.materials {
        let fractions = material.base_color.into_iter().chain([material.metallic, material.roughness]);
        assert!(fractions.chain(material.reflectance).all(|x| (0.0..=1.0).contains(&x)));
        assert!(material.ior >= 1.0);
        assert!(material.base_color_texture.as_ref().is_none_or(|use_| use_.texture < scene.textures.len()));
    }
    for object in &scene.objects {
        assert!(object.world_from_object.is_finite());
        assert_eq!(object.part_ids.len(), scene.meshes[object.mesh].parts.len());
    }
}
