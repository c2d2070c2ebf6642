//! Images of cameras and spinning sensors and their annotations, read back by third-party readers.

use echocast::export::{AnnotationStyle, ImageFolder, ImageLayer, ImageOptions};
use echocast::generate::Indoor;
use echocast::scenario::set::{self, RunOptions};
use echocast::{
    BoxAxes, BuiltScene, Field, FieldSet, Frame, LoadOptions, Named as _, PointCloud, Pose, ScanOptions, Scenario,
    Scene, Sensor, Trajectory,
};
use echocast_tests::python;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Every layer and every kind of annotation.
fn everything() -> ImageOptions {
    ImageOptions::default()
        .layers(ImageLayer::NAMES.iter().map(|(_, layer)| *layer).collect())
        .annotations(AnnotationStyle::NAMES.iter().map(|(_, style)| *style).collect())
}

fn camera(max_m: f64) -> Sensor {
    let pattern = "{type: pinhole, resolution: [96, 72], fov_deg: [70, 55]}";
    Sensor::from_yaml(&format!("{{name: eye, kind: tof, pattern: {pattern}, range: {{max_m: {max_m}}}}}"), "").unwrap()
}

fn room() -> BuiltScene {
    let generated = Indoor::default().rooms([1, 1]).scene(3).unwrap();
    generated.load(&LoadOptions::default()).unwrap().build().unwrap()
}

/// A scan with all that images show.
fn scan(scene: &BuiltScene, sensor: &Sensor, pose: Pose, options: &ImageOptions) -> PointCloud {
    let own = [Field::X, Field::Y, Field::Z, Field::Azimuth, Field::Elevation, Field::Channel];
    let scan = ScanOptions::default()
        .fields(own.into_iter().collect::<FieldSet>().union(options.fields()))
        .boxes(BoxAxes::Object)
        .image_boxes(true)
        .coordinates(Frame::Sensor);
    scene.scan(sensor, &Trajectory::fixed(pose), &scan).unwrap()
}

/// What `tests/readers/images.py` finds in the folder.
fn read(folder: &Path) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("readers/images.py");
    let output = python().arg(script).arg(folder).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice::<Vec<Value>>(&output.stdout).unwrap().remove(0)
}

/// Pixels of an array, NaN as NaN.
fn values(array: &Value) -> Vec<f64> {
    array["values"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap_or(f64::NAN)).collect()
}

fn same(found: &[f64], expected: impl IntoIterator<Item = f64>, what: &str) {
    let expected: Vec<f64> = expected.into_iter().collect();
    assert_eq!(found.len(), expected.len(), "{what}");
    for (pixel, (a, b)) in found.iter().zip(&expected).enumerate() {
        // JSON is not read to the last bit of 64.
        assert!(*a as f32 == *b as f32 || a.is_nan() && b.is_nan(), "{what}, pixel {pixel}: {a}, not {b}");
    }
}

#[test]
fn every_pixel_of_a_camera_is_read_back() {
    let (sensor, scene) = (camera(3.0), room());
    let folder = tempfile::tempdir().unwrap();
    let options = everything();
    let cloud = scan(&scene, &sensor, Pose::at(-1.0, -1.0, 1.4).with_rpy_deg(0.0, 15.0, 40.0), &options);
    let pixels = 96 * 72;
    assert!(cloud.len() > pixels / 4 && cloud.len() < pixels, "{}", cloud.len());
    let mut images = ImageFolder::create(folder.path(), &sensor, &options).unwrap();
    let report = images.add(&cloud, 7, 0.25).unwrap();
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    let mut written = images.finish().unwrap();
    written.sort();
    let mut there: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    there.sort();
    assert_eq!(written, there);

    let found = read(folder.path());
    let frame = &found["frames"][0];
    assert_eq!((&frame["frame"], &frame["time_s"]), (&7.into(), &0.25.into()));
    let layers = &frame["layers"];
    // The row of the cloud that each pixel shows.
    let mut rows = vec![None; pixels];
    cloud.columns().beam().iter().enumerate().for_each(|(row, &beam)| rows[beam as usize] = Some(row));
    let of = |column: &dyn Fn(usize) -> f64, nothing: f64| -> Vec<f64> {
        rows.iter().map(|row| row.map_or(nothing, column)).collect()
    };
    let columns = cloud.columns();
    let depth = |row: usize| f64::from(columns.depth()[row]);
    same(&values(&layers["depth"]), of(&|row| (1000.0 * depth(row)).round(), 0.0), "depth");
    same(&values(&layers["depth32"]), of(&depth, f64::NAN), "depth32");
    assert_eq!((&layers["depth"]["mode"], &layers["depth32"]["type"]), (&"I;16".into(), &"f4".into()));
    for (layer, column) in
        [("category", columns.category_id()), ("part", columns.part_id()), ("instance", columns.instance_id())]
    {
        let ids = of(&|row| f64::from(column[row]), 0.0);
        same(&values(&layers[layer]), ids.clone(), layer);
        same(&values(&layers[format!("{layer}16")]), ids.clone(), layer);
        same(&values(&layers["arrays"][format!("{layer}_id")]), ids.clone(), layer);
        assert_eq!((&layers[layer]["mode"], &layers[format!("{layer}16")]["mode"]), (&"P".into(), &"I;16".into()));
        // The palette is that of Pascal VOC: number 1 is dark red, 2 dark green, 3 both.
        let palette = layers[layer]["palette"].as_array().unwrap();
        assert_eq!(palette[..12], [0, 0, 0, 128, 0, 0, 0, 128, 0, 128, 128, 0].map(Value::from), "{layer}");
        let names: BTreeMap<String, String> =
            serde_json::from_str(layers[layer]["text"]["names"].as_str().unwrap()).unwrap();
        let seen: BTreeSet<String> = ids.iter().filter(|id| **id > 0.0).map(f64::to_string).collect();
        assert_eq!(names.keys().cloned().collect::<BTreeSet<_>>(), seen);
        let tables = cloud.labels.tables();
        let (_, table) = tables.iter().find(|(stem, _)| *stem == layer).unwrap();
        for (id, name) in names {
            assert_eq!(table.name(id.parse().unwrap()), Some(name.as_str()));
        }
    }
    let color = |row: usize| [columns.red()[row], columns.green()[row], columns.blue()[row]].map(f64::from);
    let expected = rows.iter().flat_map(|row| row.map_or([0.0; 3], color));
    same(&values(&layers["color"]), expected, "color");
    // A reflectivity of 1 is the full scale.
    assert_eq!(cloud.intensity_full_scale, Some(1.0));
    let intensity = |row: usize| (columns.intensity()[row] * 65535.0).round().min(65535.0).into();
    same(&values(&layers["intensity"]), of(&intensity, 0.0), "intensity");
    let normal =
        |row: usize| [-columns.normal_y()[row], columns.normal_z()[row], -columns.normal_x()[row]].map(f64::from);
    let expected = rows.iter().flat_map(|row| row.map_or([f64::NAN; 3], normal));
    same(&values(&layers["arrays"]["normal"]), expected, "normals");
    let bytes = |row: usize| normal(row).map(|part| (127.5 * (part + 1.0)).round());
    for (found, row) in values(&layers["normal"]).chunks(3).zip(&rows) {
        let expected = row.map_or([0.0; 3], bytes);
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 1.0), "{found:?} {expected:?}");
        // Surfaces face who sees them: blue is more than half where they are ahead.
        assert!(row.is_none() || columns.normal_x()[row.unwrap()] > 0.0 || found[2] >= 127.0);
    }

    // Depth and camera give the points.
    let camera = |key: &str| found["camera"][key].as_f64().unwrap();
    for (pixel, row) in rows.iter().enumerate() {
        let Some(row) = *row else { continue };
        let [right, down] = [(pixel % 96) as f64 - camera("cx"), (pixel / 96) as f64 - camera("cy")];
        let place = [1.0, -right / camera("fx"), -down / camera("fy")].map(|part| part * depth(row));
        let point = cloud.position(row).to_array();
        assert!(place.iter().zip(point).all(|(a, b)| (a - b).abs() < 1e-5), "{place:?} {point:?}");
    }

    // COCO's masks are the image of instances, and so are its segments.
    let instances = of(&|row| f64::from(columns.instance_id()[row]), 0.0);
    same(&values(&frame["coco"]["instances"]), instances.clone(), "coco");
    same(&values(&frame["panoptic"]["ids"]), instances.clone(), "panoptic");
    let annotations = frame["coco"]["annotations"].as_array().unwrap();
    let objects = frame["voc"]["objects"].as_array().unwrap();
    assert_eq!(annotations.len(), objects.len());
    assert_eq!(
        (&frame["voc"]["filename"], &frame["voc"]["size"]),
        (&"color_0007.png".into(), &serde_json::json!([96, 72, 3]))
    );
    for (annotation, object) in annotations.iter().zip(objects) {
        assert_eq!(annotation["instance_id"], object["instance"]);
        let id = annotation["category_id"].as_u64().unwrap() as u32;
        assert_eq!(object["name"].as_str(), cloud.labels.category.name(id));
        let numbers = |value: &Value| -> [f64; 4] {
            let all: Vec<f64> = value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect();
            all.try_into().unwrap()
        };
        let [left, top, width, height] = numbers(&annotation["bbox"]);
        assert_eq!(numbers(&object["bndbox"]), [left + 1.0, top + 1.0, left + width, top + height]);
        // What is seen of it is within all of it, to the pixel that its edge passes.
        let [whole_left, whole_top, whole_width, whole_height] = numbers(&annotation["amodal_bbox"]);
        assert!(whole_left <= left + 1.0 && whole_left + whole_width >= left + width - 1.0, "{annotation}");
        assert!(whole_top <= top + 1.0 && whole_top + whole_height >= top + height - 1.0, "{annotation}");
    }
}

#[test]
fn depths_between_two_distances_and_beyond() {
    let (sensor, scene) = (camera(3.0), room());
    let folder = tempfile::tempdir().unwrap();
    let options = ImageOptions::default().layers(vec![ImageLayer::Depth]).depth_range_m([1.0, 2.5]);
    let cloud = scan(&scene, &sensor, Pose::at(-1.0, -1.0, 1.4), &options);
    let mut images = ImageFolder::create(folder.path(), &sensor, &options).unwrap();
    let report = images.add(&cloud, 0, 0.0).unwrap();
    assert!(report.warnings.iter().any(|text| text.contains("above 2.5 m")), "{:?}", report.warnings);
    images.finish().unwrap();
    let found = read(folder.path());
    assert_eq!(found["depth"], serde_json::json!({"nothing": 0, "1": 1.0, "65535": 2.5, "unit": "m"}));
    let pixels = values(&found["frames"][0]["layers"]["depth"]);
    assert_eq!(pixels.iter().filter(|value| **value > 0.0).count(), cloud.len());
    for (&beam, &depth) in cloud.columns().beam().iter().zip(cloud.columns().depth()) {
        let value = pixels[beam as usize];
        let back = 1.0 + (value - 1.0) / 65534.0 * 1.5;
        assert!((back - f64::from(depth).clamp(1.0, 2.5)).abs() <= 0.75 / 65534.0 + 1e-9, "{depth}: {value}");
    }
}

#[test]
fn a_spinning_sensor_has_an_image_all_around() {
    let scene = room();
    // The first has channels in no order, the second looks to several sides at a time.
    for name in ["velodyne_vlp16", "velodyne_vlp32c"] {
        let sensor = Sensor::preset(name).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let options = everything().layers(vec![ImageLayer::Arrays]);
        let cloud = scan(&scene, &sensor, Pose::at(0.3, 0.0, 1.4), &options);
        let mut images = ImageFolder::create(folder.path(), &sensor, &options).unwrap();
        images.add(&cloud, 0, 0.0).unwrap();
        images.finish().unwrap();
        let found = read(folder.path());
        let [width, height] = ["width", "height"].map(|key| found[key].as_u64().unwrap() as usize);
        let arrays = &found["frames"][0]["layers"]["arrays"];
        let ranges = values(&arrays["range"]);
        let columns = cloud.columns();
        let mut elevations: Vec<f32> = columns.elevation().to_vec();
        elevations.sort_by(f32::total_cmp);
        elevations.dedup_by(|a, b| (*a - *b).abs() < 1e-5);
        assert_eq!(elevations.len(), height, "{name}");
        let mut shown = 0;
        for row in 0..cloud.len() {
            let line = elevations.iter().rev().position(|e| (e - columns.elevation()[row]).abs() < 2e-5).unwrap();
            let step = std::f32::consts::TAU / width as f32;
            let column = (std::f32::consts::PI - columns.azimuth()[row]) / step;
            // In its row, near its azimuth: a turn is not a whole number of steps, and channels fire one after the other.
            let near = (-2..=2).map(|off| (column as i64 + off).rem_euclid(width as i64) as usize);
            let holds = near.map(|column| ranges[line * width + column]);
            shown += usize::from({ holds }.any(|range| range as f32 == columns.range()[row]));
        }
        // Of two returns of a beam, the nearest is shown.
        let beams: BTreeSet<u32> = columns.beam().iter().copied().collect();
        assert_eq!(ranges.iter().filter(|range| !range.is_nan()).count(), beams.len(), "{name}");
        assert!(shown >= beams.len(), "{name}: {shown} of {}", beams.len());
    }
}

/// Two boxes, of which `Near` hides a part of `Far`, that reaches out of the image on the left.
const BOXES: &str = "
o Near
v 3 -0.5 -0.4\nv 3 0.3 -0.4\nv 3 0.3 0.6\nv 3 -0.5 0.6
f 1 2 3 4
o Far
v 5 0.0 -0.5\nv 5 9.0 -0.5\nv 5 9.0 1.0\nv 5 0.0 1.0\nv 6 0.0 -0.5\nv 6 9.0 -0.5\nv 6 9.0 1.0\nv 6 0.0 1.0
f 5 6 7 8\nf 9 10 11 12\nf 5 6 10 9\nf 7 8 12 11
";

#[test]
fn what_is_hidden_and_outside_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("boxes.obj");
    fs::write(&file, BOXES).unwrap();
    let sensor = camera(20.0);
    let options = ImageOptions::default().annotations(vec![AnnotationStyle::Coco]);
    let found = |hide: &[&str], name: &str| -> Value {
        let load = LoadOptions::default().hide(hide.iter().map(|&name| name.to_owned()).collect());
        let scene = Scene::load_with(&file, &load).unwrap().build().unwrap();
        let cloud = scan(&scene, &sensor, Pose::IDENTITY, &options);
        let to = folder.path().join(hide.concat());
        let mut images = ImageFolder::create(&to, &sensor, &options).unwrap();
        images.add(&cloud, 0, 0.0).unwrap();
        images.finish().unwrap();
        let found = read(&to);
        let all = found["frames"][0]["coco"]["annotations"].as_array().unwrap();
        all.iter().find(|one| one["instance"] == name).unwrap().clone()
    };
    let (partly, alone) = (found(&["Nothing"], "Far"), found(&["Near"], "Far"));
    let number = |one: &Value, key: &str| one[key].as_f64().unwrap();
    // Pixels that it has, and those that it would have alone.
    let expected = 1.0 - number(&partly, "area") / number(&alone, "area");
    assert!(expected > 0.1 && (number(&partly, "occlusion") - expected).abs() < 1e-3, "{partly} {alone}");
    assert_eq!(number(&alone, "occlusion"), 0.0);
    // Its corners through the camera, by hand.
    let focal = [48.0 / 35f64.to_radians().tan(), 36.0 / 27.5f64.to_radians().tan()];
    let [left, top] = [48.0 - focal[0] * 9.0 / 5.0, 36.0 - focal[1] * 1.0 / 5.0];
    let [right, bottom] = [48.0, 36.0 + focal[1] * 0.5 / 5.0];
    let box_of = |one: &Value| -> Vec<f64> {
        one["amodal_bbox"].as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
    };
    for one in [&partly, &alone] {
        for (a, b) in box_of(one).iter().zip([left, top, right - left, bottom - top]) {
            assert!((a - b).abs() < 2e-3, "{one}: {a} {b}");
        }
        let outside = -left / (right - left);
        assert!((number(one, "truncation") - outside).abs() < 1e-3, "{one} {outside}");
    }
    let near = found(&["Nothing"], "Near");
    assert_eq!((number(&near, "truncation"), number(&near, "occlusion")), (0.0, 0.0));
}

#[test]
fn numbers_beyond_16_bits_are_renumbered_and_told() {
    let sensor = camera(20.0);
    let options = ImageOptions::default().layers(vec![ImageLayer::Instance, ImageLayer::Category]).annotations(vec![
        AnnotationStyle::Panoptic,
        AnnotationStyle::Voc,
        AnnotationStyle::Coco,
    ]);
    let mut cloud = scan(&room(), &sensor, Pose::at(-1.0, -1.0, 1.4), &options);
    let mut labels = (*cloud.labels).clone();
    let shift = 17_000_000;
    cloud.columns_mut().instance_id.iter_mut().for_each(|id| *id += shift);
    labels.instance = labels.instance.iter().map(|(id, name)| (id + shift, name.to_owned())).collect();
    labels.category = labels.category.iter().map(|(id, name)| (id + 300, format!("{name} <&> Ü"))).collect();
    cloud.columns_mut().category_id.iter_mut().for_each(|id| *id += 300);
    cloud.labels = labels.clone().into();
    let folder = tempfile::tempdir().unwrap();
    let mut images = ImageFolder::create(folder.path(), &sensor, &options).unwrap();
    let report = images.add(&cloud, 0, 0.0).unwrap();
    assert!(report.warnings.iter().any(|text| text.contains("renumbered")), "{:?}", report.warnings);
    images.finish().unwrap();
    let found = read(folder.path());
    let frame = &found["frames"][0];
    let layer = &frame["layers"]["instance"];
    let numbers: BTreeMap<String, u32> = serde_json::from_str(layer["text"]["numbers"].as_str().unwrap()).unwrap();
    let pixels = values(layer);
    let (ids, segments) = (values(&frame["coco"]["instances"]), values(&frame["panoptic"]["ids"]));
    let named: BTreeMap<u64, u64> = frame["panoptic"]["segments"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| (one["id"].as_u64().unwrap(), one["instance_id"].as_u64().unwrap()))
        .collect();
    for (&beam, &id) in cloud.columns().beam().iter().zip(cloud.columns().instance_id()) {
        let beam = beam as usize;
        assert_eq!(numbers[&pixels[beam].to_string()], id);
        assert_eq!(ids[beam], f64::from(id));
        assert_eq!(named[&(segments[beam] as u64)], u64::from(id));
    }
    // Categories from 301 on do not fit into a palette.
    assert_eq!(frame["layers"]["category"]["mode"], "I;16");
    for object in frame["voc"]["objects"].as_array().unwrap() {
        assert!(object["name"].as_str().unwrap().ends_with(" <&> Ü"), "{object}");
    }
}

/// A camera and a spinning sensor in rooms that differ, so that categories have other numbers from sample to sample.
const SET: &str = "
scene: {generate: {indoor: {rooms: [1, 1], furniture: 0.5}, seed: 1}}
sensors:
  - {name: eye, sensor: {name: eye, kind: tof, pattern: {type: pinhole, resolution: [64, 48], fov_deg: [70, 55]}}}
  - {name: around, sensor: {name: around, kind: lidar, pattern: {type: spinning, azimuth: {fov_deg: 360, step_deg: 2}, \
     elevation: {fov_deg: 60, step_deg: 4}}}}
trajectory: {position_m: [0, 0, 1.4]}
frames: {first: 0, last: 1}
samples: 6
set: {splits: 60/40, licence: CC0-1.0}
variation:
  - {set: scene.generate.seed, to: {uniform: [0, 1000]}}
outputs:
  - {style: coco, layers: [color, instance, depth], panoptic: true}
  - {style: voc, sensor: eye}
";

#[test]
fn sets_of_images_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = Scenario::from_yaml(SET, folder.path()).unwrap();
    let to = folder.path().join("set");
    let options = RunOptions::default().folder(to.clone()).samples(None).shard(None).resume(false).threads(0);
    let summary = set::run(scenario, &options, &|_| ()).unwrap();
    assert!(summary.complete && summary.failed.is_empty(), "{:?}", summary.failed);
    assert_eq!(set::check_folder(&to).unwrap(), Vec::<String>::new());
    let found = read(&to);
    let mut samples = BTreeSet::new();
    for part in ["train", "val"] {
        let coco = &found["coco"][part];
        let lines = fs::read_to_string(to.join(format!("splits/{part}.txt"))).unwrap();
        let expected: Vec<String> = lines.lines().map(str::to_owned).collect();
        samples.extend(expected.clone());
        // Two sensors and two frames.
        let of = |sensors: &[&str]| -> Vec<String> {
            let names = |sample: &String| {
                let frames = |sensor: &&str| [0, 1].map(|frame| format!("{sample}{sensor}_000{frame}"));
                sensors.iter().flat_map(frames).collect::<Vec<_>>()
            };
            expected.iter().flat_map(names).collect()
        };
        let pictures: Vec<String> = of(&["_eye", "_around"]).into_iter().map(|name| name + ".png").collect();
        assert_eq!(coco["images"], serde_json::json!(pictures));
        assert_eq!(found["voc"][part], serde_json::json!(of(&[""])));
        assert_eq!(coco["licenses"], serde_json::json!([{"id": 1, "name": "CC0-1.0", "url": ""}]));
        let seen = coco["seen"].as_array().unwrap();
        assert!(expected.is_empty() || seen.contains(&"wall".into()) && seen.contains(&"floor".into()), "{seen:?}");
    }
    assert_eq!(samples.len(), 6);
}

#[test]
fn sets_without_images_are_refused() {
    for style in ["coco", "voc"] {
        let folder = tempfile::tempdir().unwrap();
        let text = format!(
            "{{scene: {{generate: {{indoor: {{}}}}}}, sensors: [{{sensor: livox_avia}}], trajectory: {{position_m: [0, 0, 1]}}, \
             outputs: [{{style: {style}}}]}}"
        );
        let scenario = Scenario::from_yaml(&text, folder.path()).unwrap();
        let options =
            RunOptions::default().folder(folder.path().join("set")).samples(None).shard(None).resume(false).threads(0);
        let error = set::run(scenario, &options, &|_| ()).unwrap_err().to_string();
        assert!(error.contains("no rows and columns"), "{error}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "{style}");
    }
}
