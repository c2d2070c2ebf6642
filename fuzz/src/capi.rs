//! The C ABI: calls in any order, with handles that live, are gone, or never were, and with odd numbers and texts.
//! Every call is answered with a status, never with a defect of the library, and what a result shows is there.

use echocast_capi::*;
use std::ffi::{CStr, c_char, c_void};
use std::ptr;

/// The input, read byte by byte; then nothing but 0.
struct Input<'a>(&'a [u8]);

impl Input<'_> {
    fn byte(&mut self) -> u8 {
        let (first, rest) = self.0.split_first().unwrap_or((&0, &[]));
        self.0 = rest;
        *first
    }

    fn below(&mut self, count: usize) -> usize {
        usize::from(self.byte()) % count
    }

    fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }

    fn number(&mut self) -> f64 {
        let plain = f64::from(self.byte()) / 16.0 - 8.0;
        self.of(&[plain, plain, plain, plain, 0.0, 1.0, -1.0, f64::NAN, f64::INFINITY, 1e30, -1e18, 1e-30])
    }

    fn pose(&mut self) -> echocast_pose {
        let mut pose = echocast_pose { m: [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0] };
        for _ in 0..self.below(4) {
            pose.m[self.below(12)] = self.number();
        }
        // Mostly only moved.
        for entry in [3, 7, 11] {
            pose.m[entry] = self.number();
        }
        pose
    }

    fn text(&mut self) -> *const c_char {
        const TEXTS: &[&CStr] = &[
            c"", c"a", c"all", c"x", c"x,y,z,range", c"range", c"intensity,normal_x,category_id", c"default", c"category",
            c"part", c"instance", c"material", c"{name: paint, reflectance: 0.5}", c"{name: 1", c"box", c"\xff", c"0",
            c"noise.range_sigma_m", c"noise.dropout", c"0.5", c"-1", c"{}", c"null", c"range.max_m", c"detection",
            c"{model: reflectivity_limit, lower: {reflectance: 0.5, at_m: 2}, upper: {reflectance: 0.9, at_m: 8}}",
            c"pattern.azimuth.step_deg", c"kinect_v1", c"{scale: 0.5, up: y}",
            c"{name: s, kind: lidar, pattern: {type: raster, azimuth: {fov_deg: 40, step_deg: 2}, elevation: {fov_deg: 10, step_deg: 2}}}",
            c"{view: waterfall}", c"values", c"intensity", c"{name: b, kind: sonar, pattern: {type: single_beam, beam_deg: 20, rays: 64}, range: {max_m: 20}, acoustics: {frequency_khz: 200, source_level_db: 200, pulse_ms: 0.5, bounces: 0}}",
            c"{name: p, kind: tof, pattern: {type: pinhole, resolution: [8, 6], fov_deg: [60, 40]}, noise: {range_sigma_m: 0.1}}",
        ];
        if self.below(16) == 0 { ptr::null() } else { self.of(TEXTS).as_ptr() }
    }
}

/// Handles of one kind; some of nothing.
struct Handles<T>(Vec<*mut T>);

impl<T> Handles<T> {
    fn any(&self, input: &mut Input) -> *mut T {
        match input.byte() {
            0 => ptr::null_mut(),
            1 => ptr::without_provenance_mut(usize::from(input.byte()) << 56 | 1 << 24),
            _ if self.0.is_empty() => ptr::null_mut(),
            _ => self.0[input.below(self.0.len())],
        }
    }

    fn keep(&mut self, handle: *mut T) {
        if !handle.is_null() {
            self.0.push(handle);
        }
    }
}

#[track_caller]
fn answered(status: echocast_status) {
    assert_ne!(status, ECHOCAST_E_INTERNAL, "{:?}", unsafe { CStr::from_ptr(echocast_last_error()) });
}

const CORNERS: [f32; 24] = [
    -1.0, -1.0, -1.0, 1.0, -1.0, -1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0,
    1.0, 1.0, 1.0, 1.0,
];
const INDICES: [u32; 36] =
    [0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6];

/// Runs it with one input.
pub fn run(data: &[u8]) {
    let mut input = Input(data);
    let input = &mut input;
    let mut contexts: Handles<echocast_context> = Handles(Vec::new());
    let mut materials: Handles<echocast_material> = Handles(Vec::new());
    let mut meshes: Handles<echocast_mesh> = Handles(Vec::new());
    let mut scenes: Handles<echocast_scene> = Handles(Vec::new());
    let mut snapshots: Handles<echocast_snapshot> = Handles(Vec::new());
    let mut sensors: Handles<echocast_sensor> = Handles(Vec::new());
    let mut results: Handles<echocast_result> = Handles(Vec::new());
    let mut pings: Handles<echocast_pings> = Handles(Vec::new());
    let mut ids: Vec<echocast_instance> = vec![0, 1, u64::MAX];
    // SAFETY: pointers are NULL or to what is there; handles may be anything.
    unsafe {
        let one = echocast_context_desc { threads: 1, ..Default::default() };
        let mut context = ptr::null_mut();
        answered(echocast_context_create(&one, &mut context));
        contexts.keep(context);
        for _ in 0..data.len().min(200) {
            let call = input.below(31);
            match call {
                0 => {
                    let mut out = ptr::null_mut();
                    let desc = echocast_context_desc {
                        threads: input.of(&[1, 1, 2, -1, 5000]),
                        struct_size: input.of(&[size_of::<echocast_context_desc>(), 8, 12, 0]),
                        ..Default::default()
                    };
                    answered(echocast_context_create(&desc, &mut out));
                    contexts.keep(out);
                }
                1 => echocast_context_release(contexts.any(input)),
                2 => {
                    let mut out = ptr::null_mut();
                    let pixels = [7; 16];
                    let image = echocast_image {
                        data: pixels.as_ptr(),
                        width: input.of(&[1, 2, 0]),
                        height: input.of(&[1, 2]),
                        channels: input.of(&[3, 4, 1]),
                        ..Default::default()
                    };
                    let image = if input.byte() < 128 { ptr::null() } else { &raw const image };
                    answered(echocast_material_create(contexts.any(input), input.text(), image, &mut out));
                    materials.keep(out);
                }
                3 => echocast_material_release(materials.any(input)),
                4 => {
                    let parts = [0, 6].map(|first_triangle| echocast_part {
                        first_triangle,
                        triangle_count: input.of(&[6, 6, 6, 12, 0, u32::MAX]),
                        material: if input.byte() < 99 { materials.any(input) } else { ptr::null_mut() },
                        part_id: input.byte().into(),
                        reserved: 0,
                    });
                    let mut corners = CORNERS;
                    corners[input.below(24)] = input.number() as f32;
                    let desc = echocast_mesh_desc {
                        positions: corners.as_ptr(),
                        vertex_count: input.of(&[8, 8, 8, 7, 0]),
                        indices: INDICES.as_ptr(),
                        triangle_count: input.of(&[12, 12, 12, 11, 0]),
                        normals: if input.byte() < 99 { CORNERS.as_ptr() } else { ptr::null() },
                        uvs: if input.byte() < 99 { CORNERS.as_ptr() } else { ptr::null() },
                        parts: parts.as_ptr(),
                        part_count: input.of(&[0, 2, 1]),
                        ..Default::default()
                    };
                    let mut out = ptr::null_mut();
                    answered(echocast_mesh_create(contexts.any(input), &desc, &mut out));
                    meshes.keep(out);
                }
                5 => answered(echocast_mesh_prepare(meshes.any(input))),
                6 => echocast_mesh_release(meshes.any(input)),
                7 => {
                    let origin = [input.number(), input.number(), 0.0];
                    let desc = echocast_scene_desc { origin: origin.as_ptr(), ..Default::default() };
                    let desc = if input.byte() < 128 { ptr::null() } else { &raw const desc };
                    let mut out = ptr::null_mut();
                    answered(echocast_scene_create(contexts.any(input), desc, &mut out));
                    scenes.keep(out);
                }
                8 => echocast_scene_release(scenes.any(input)),
                9 => {
                    let obj = b"glTF nothing of the kind";
                    answered(echocast_scene_load_memory(
                        scenes.any(input),
                        obj.as_ptr().cast(),
                        obj.len(),
                        input.text(),
                    ));
                }
                10..=12 => {
                    let desc = echocast_instance_desc {
                        mesh: meshes.any(input),
                        pose: input.pose(),
                        category_id: input.byte().into(),
                        instance_id: input.byte().into(),
                        mask: input.of(&[u32::MAX, 1, 2, 0]),
                        fixed: input.of(&[0, 1, 2]),
                        material: if input.byte() < 60 { materials.any(input) } else { ptr::null_mut() },
                        name: input.text(),
                        ..Default::default()
                    };
                    let mut id = 0;
                    answered(echocast_scene_add(scenes.any(input), &desc, &mut id));
                    ids.push(id);
                }
                13 => {
                    let id = input.of(&ids);
                    answered(echocast_scene_remove(scenes.any(input), id));
                }
                14 | 15 => {
                    let (id, pose) = ([input.of(&ids), input.of(&ids)], [input.pose(), input.pose()]);
                    answered(echocast_scene_set_poses(scenes.any(input), input.below(3), id.as_ptr(), pose.as_ptr()));
                }
                16 => {
                    let mut corners = CORNERS;
                    corners[input.below(24)] = input.number() as f32;
                    let id = input.of(&ids);
                    let normals = if input.byte() < 99 { CORNERS.as_ptr() } else { ptr::null() };
                    answered(echocast_scene_set_vertices(
                        scenes.any(input),
                        id,
                        corners.as_ptr(),
                        normals,
                        input.of(&[8, 7, 0]),
                    ));
                }
                17 => {
                    let (id, parts) = (input.of(&ids), [3, 4]);
                    let parts = if input.byte() < 128 { ptr::null() } else { parts.as_ptr() };
                    answered(echocast_scene_set_labels(
                        scenes.any(input),
                        id,
                        1,
                        input.byte().into(),
                        parts,
                        input.below(3),
                    ));
                    answered(echocast_scene_set_mask(scenes.any(input), id, input.of(&[0, 1, u32::MAX])));
                    answered(echocast_scene_set_material(scenes.any(input), id, materials.any(input)));
                }
                18 => {
                    answered(echocast_scene_name_label(
                        scenes.any(input),
                        input.text(),
                        input.byte().into(),
                        input.text(),
                    ));
                    let mut id = 0;
                    answered(echocast_scene_find(scenes.any(input), input.text(), &mut id));
                    ids.push(id);
                    let mut instance = echocast_instance_info::default();
                    answered(echocast_scene_get_instance(scenes.any(input), id, &mut instance));
                    let mut all = [0; 4];
                    answered(echocast_scene_get_instances(
                        scenes.any(input),
                        input.below(3),
                        4,
                        all.as_mut_ptr(),
                        ptr::null_mut(),
                    ));
                    let mut info = echocast_scene_info::default();
                    answered(echocast_scene_get_info(scenes.any(input), &mut info));
                }
                19 | 20 => {
                    let mut out = ptr::null_mut();
                    answered(echocast_scene_commit(scenes.any(input), &mut out));
                    snapshots.keep(out);
                }
                21 => echocast_snapshot_release(snapshots.any(input)),
                22 => {
                    let mut out = ptr::null_mut();
                    let beams = [1.0, -1.0, input.number() as f32].map(|x| echocast_beam {
                        t_ns: input.of(&[0, 1000, i64::MIN, i64::MAX]),
                        direction: [x, 0.0, 0.0],
                        range_min_m: input.of(&[0.0, 0.0, 1.0, f32::NAN]),
                        range_max_m: input.of(&[0.0, 0.0, 9.0, f32::INFINITY]),
                        channel: input.of(&[0, 1, 70_000]),
                        origin: [0.0, 0.0, input.of(&[0.0, 0.0, 1.0, f32::NAN])],
                        reserved: 0,
                    });
                    let made = if input.byte() < 160 {
                        echocast_sensor_from_text(contexts.any(input), input.text(), ptr::null(), &mut out)
                    } else {
                        let rows = input.of(&[1, 1, 0, u32::MAX]);
                        let desc = echocast_beams_desc {
                            name: input.text(),
                            beams: beams.as_ptr(),
                            rows,
                            columns: if rows == u32::MAX { u32::MAX } else { input.of(&[3, 2, 0]) },
                            period_ns: input.of(&[1_000_000, 0, i64::MIN]),
                            ..Default::default()
                        };
                        echocast_sensor_from_beams(contexts.any(input), &desc, &mut out)
                    };
                    answered(made);
                    sensors.keep(out);
                }
                23 => {
                    let sensor = sensors.any(input);
                    answered(echocast_sensor_set(sensor, input.text(), input.text()));
                    let (mut value, mut low, mut high) = (0.0, 0.0, 0.0);
                    answered(echocast_sensor_get(sensor, input.text(), &mut value, &mut low, &mut high));
                    let mut text = [1; 100];
                    let mut needed = 0;
                    answered(echocast_sensor_describe(sensor, text.as_mut_ptr(), input.below(100), &mut needed));
                    if input.byte() < 20 {
                        echocast_sensor_release(sensor);
                    }
                }
                24..=26 | 30 => {
                    let keys = [(); 2].map(|()| echocast_pose_key {
                        t_ns: input.of(&[0, 1, 100_000_000, i64::MAX, i64::MIN]),
                        pose: input.pose(),
                    });
                    let desc = echocast_scan_desc {
                        sensor: sensors.any(input),
                        poses: keys.as_ptr(),
                        pose_count: input.of(&[1, 1, 2, 0]),
                        t0_ns: input.of(&[0, 50_000_000, i64::MIN]),
                        seed: input.byte().into(),
                        mask: input.of(&[u32::MAX, 1, 0]),
                        columns: input.text(),
                        organised: input.of(&[0, 1, 7]),
                        coordinates: input.of(&[0, 1]),
                        order: input.of(&[0, 0, 1]),
                        profile: input.of(&[0, 1, 2, 3]),
                        reflectance: input.of(&[0, 1, 2]),
                        ..Default::default()
                    };
                    let new = input.byte() < 128;
                    if call == 30 {
                        let mut list = if new { ptr::null_mut() } else { pings.any(input) };
                        let before = list;
                        answered(echocast_ping(snapshots.any(input), &desc, &mut list));
                        if before.is_null() {
                            pings.keep(list);
                        }
                        continue;
                    }
                    let mut result = if new { ptr::null_mut() } else { results.any(input) };
                    let before = result;
                    answered(echocast_scan(snapshots.any(input), &desc, &mut result));
                    if before.is_null() {
                        results.keep(result);
                    }
                }
                28 | 29 => {
                    let (list, ping) = (pings.any(input), input.of(&[0, 0, 0, 1, usize::MAX]));
                    let mut info = echocast_ping_info::default();
                    let status = echocast_pings_get_info(list, ping, &mut info);
                    answered(status);
                    let mut view = std::mem::zeroed();
                    let shown = echocast_pings_view(list, ping, input.text(), &mut view);
                    answered(shown);
                    if shown == ECHOCAST_OK {
                        assert_eq!(view.count, info.beams as usize * info.bins as usize);
                        let bytes = std::slice::from_raw_parts(view.data.cast::<u8>(), view.count * view.stride);
                        std::hint::black_box(bytes.iter().map(|&byte| u64::from(byte)).sum::<u64>());
                    }
                    let mut depths = std::mem::zeroed();
                    answered(echocast_pings_soundings(list, ping, &mut depths));
                    assert!(depths.count <= info.beams as usize);
                    let mut packed = [0u8; 4096];
                    let item = echocast_pack_item {
                        column: input.text(),
                        kind: input.of(&[1, 2, 3, 5, 9, 11]),
                        offset: input.of(&[0, 4, u32::MAX]),
                        shift: input.number(),
                        scale: input.number(),
                    };
                    let (to, stride) = (packed.as_mut_ptr().cast(), input.of(&[8, 4, 16, 0, usize::MAX]));
                    answered(echocast_pings_pack(list, ping, &item, 1, stride, to, packed.len(), ptr::null_mut()));
                    let mut image = std::mem::zeroed();
                    answered(echocast_pings_image(list, input.text(), input.text(), &mut image, ptr::null_mut()));
                    answered(echocast_pings_append(list, pings.any(input)));
                    if input.byte() < 30 {
                        echocast_pings_release(list);
                    }
                }
                _ => {
                    let result = results.any(input);
                    let mut view = std::mem::zeroed();
                    let status = echocast_result_view(result, input.text(), &mut view);
                    answered(status);
                    if status == ECHOCAST_OK {
                        assert_eq!(view.count, echocast_result_count(result));
                        // All of it can be read.
                        let bytes: &[u8] = match view.count {
                            0 => &[],
                            count => std::slice::from_raw_parts(view.data.cast(), count * view.stride),
                        };
                        std::hint::black_box(bytes.iter().map(|&byte| u64::from(byte)).sum::<u64>());
                    }
                    let mut packed = [0u8; 4096];
                    let item = echocast_pack_item {
                        column: input.text(),
                        kind: input.of(&[1, 2, 3, 5, 9, 11]),
                        offset: input.of(&[0, 4, u32::MAX]),
                        shift: input.number(),
                        scale: input.number(),
                    };
                    let mut needed = 0;
                    let to: *mut c_void = packed.as_mut_ptr().cast();
                    let stride = input.of(&[8, 4, 16, 0, usize::MAX]);
                    answered(echocast_result_pack(result, &item, 1, stride, to, packed.len(), &mut needed));
                    let name = echocast_result_label_name(result, input.text(), input.byte().into());
                    assert!(name.is_null() || CStr::from_ptr(name).count_bytes() < 1000);
                    answered(echocast_result_append(result, results.any(input)));
                    if input.byte() < 30 {
                        echocast_result_release(result);
                    }
                }
            }
        }
        results.0.iter().for_each(|&handle| echocast_result_release(handle));
        pings.0.iter().for_each(|&handle| echocast_pings_release(handle));
        sensors.0.iter().for_each(|&handle| echocast_sensor_release(handle));
        snapshots.0.iter().for_each(|&handle| echocast_snapshot_release(handle));
        scenes.0.iter().for_each(|&handle| echocast_scene_release(handle));
        meshes.0.iter().for_each(|&handle| echocast_mesh_release(handle));
        materials.0.iter().for_each(|&handle| echocast_material_release(handle));
        contexts.0.iter().for_each(|&handle| echocast_context_release(handle));
    }
}
