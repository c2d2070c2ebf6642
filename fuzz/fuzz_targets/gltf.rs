//! Whatever the bytes, reading a glTF file gives an error or a scene that keeps its promises.
//!
//! `cargo fuzz run -s none gltf fuzz/corpus/gltf fuzz/seeds/gltf -- -dict=fuzz/gltf.dict`
#![no_main]

use echocast::{LoadOptions, Scene};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Ok(scene) = Scene::from_glb_bytes(data, &LoadOptions::default()) else { return };
    for mesh in &scene.meshes {
        for part in &mesh.parts {
            let vertices = part.positions.len();
            assert!(part.positions.iter().flatten().all(|x| x.is_finite()));
            assert!(part.triangles.iter().flatten().all(|&index| (index as usize) < vertices));
            assert!(part.normals.as_ref().is_none_or(|normals| {
                normals.len() == vertices && normals.iter().flatten().all(|x| x.is_finite())
            }));
            assert!(part.uvs.as_ref().is_none_or(|uvs| uvs.len() == vertices));
            assert!(part.material.is_none_or(|index| index < scene.materials.len()));
        }
    }
    for material in &scene.materials {
        let texture = material.base_color_texture.as_ref().map(|use_| use_.texture);
        assert!(texture.is_none_or(|index| index < scene.textures.len()));
    }
    for object in &scene.objects {
        assert!(object.world_from_object.is_finite());
        assert_eq!(object.part_ids.len(), scene.meshes[object.mesh].parts.len());
    }
});
