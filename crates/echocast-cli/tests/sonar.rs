//! Sonars: pings, their pictures and files, and points.

mod common;

use common::{csv_column, files, report, run, stderr, stdout};
use std::path::Path;
use std::{fs, str};

/// 5 pings over a small lake, straight ahead.
const SURVEY: &str = "time_s,x,y,z,qx,qy,qz,qw\n0,-4,0,-3,0,0,0,1\n0.8,4,0,-3,0,0,0,1\n";
const SIDES: &str = "scan DIR/lake.glb --sensor sss_450 --set pattern.rays=256 --set pattern.rate_hz=5 --set range.max_m=20 \
                     --set acoustics.bin_m=0.1 --trajectory DIR/survey.csv";

/// A folder with `lake.glb`, 12 m deep, and `survey.csv`.
fn lake() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    stdout(folder.path(), "generate seabed --size 20,20 --cell 0.5 --boulders 5 --fish 0 -q -o DIR/lake.glb");
    fs::write(folder.path().join("survey.csv"), SURVEY).unwrap();
    folder
}

fn is_png(file: &Path) -> bool {
    fs::read(file).unwrap().starts_with(b"\x89PNG")
}

/// The shape and the bytes of the elements of array `name` of an NPZ file, whose parts are stored as they are.
fn npz_array(file: &Path, name: &str) -> (Vec<usize>, Vec<u8>) {
    let bytes = fs::read(file).unwrap();
    let find = |what: &[u8]| bytes.windows(what.len()).position(|window| window == what);
    let start = find(format!("{name}.npy").as_bytes()).unwrap_or_else(|| panic!("no array {name}"));
    let npy = start + bytes[start..].windows(6).position(|window| window == b"\x93NUMPY").unwrap();
    let length = usize::from(u16::from_le_bytes([bytes[npy + 8], bytes[npy + 9]]));
    let header = str::from_utf8(&bytes[npy + 10..npy + 10 + length]).unwrap();
    let between = |from: &str, to: char| header.split_once(from).unwrap().1.split(to).next().unwrap();
    let size: usize = between("'descr': '", '\'')[2..].parse().unwrap();
    let shape: Vec<usize> = between("'shape': (", ')').split(',').filter_map(|text| text.trim().parse().ok()).collect();
    let count: usize = shape.iter().product();
    let data = npy + 10 + length;
    (shape, bytes[data..data + size * count].to_vec())
}

#[test]
fn rays_of_the_paper_are_explained() {
    let folder = lake();
    for (profile, equation) in
        [("paper", "sonar equation, eq. 6 of the paper, dB"), ("blainder", "as the program computes it")]
    {
        let said = stdout(folder.path(), &format!("{SIDES} --profile {profile} --explain 5"));
        assert!(said.starts_with("ray 5 of 512 of sss_450 in the profile ") && said.contains(equation), "{said}");
    }
}

#[test]
fn a_sonar_pings_all_along_its_way() {
    let folder = lake();
    let folder = folder.path();
    let said = stdout(
        folder,
        &format!(
            "{SIDES} --preview DIR/falls.png --view waterfall --color intensity --image DIR/falls.npz --pings DIR/pings.npz"
        ),
    );
    // No points were requested.
    assert!(said.contains("sss_450 in") && said.contains("lake.glb: 10 beams (2,560 rays), 5 pings\n"), "{said}");
    assert!(is_png(&folder.join("falls.png")));
    assert_eq!(files(folder), ["falls.npz", "falls.png", "lake.glb", "pings.npz", "survey.csv"]);

    let (shape, levels) = npz_array(&folder.join("pings.npz"), "level");
    assert_eq!(shape, [5, 2, 200]);
    let levels: Vec<f32> = levels.chunks(4).map(|value| f32::from_le_bytes(value.try_into().unwrap())).collect();
    // The bed, nowhere nearer than 7 m, is well above the water before it.
    let mean = |bins: std::ops::Range<usize>| levels[bins.clone()].iter().sum::<f32>() / bins.len() as f32;
    assert!(mean(110..180) > mean(20..60) + 30.0, "{} {}", mean(110..180), mean(20..60));
    let (_, ids) = npz_array(&folder.join("pings.npz"), "category_id");
    assert!(ids.chunks(4).any(|id| id != [0; 4]));
    let (shape, times) = npz_array(&folder.join("pings.npz"), "ping_time");
    let times: Vec<f64> = times.chunks(8).map(|value| f64::from_le_bytes(value.try_into().unwrap())).collect();
    assert!(
        shape == [5] && times.iter().zip([0.0, 0.2, 0.4, 0.6, 0.8]).all(|(a, b)| (a - b).abs() < 1e-9),
        "{times:?}"
    );
    // Port reversed, then starboard.
    assert_eq!(npz_array(&folder.join("falls.npz"), "values").0, [5, 400]);
}

#[test]
fn fewer_pings_and_other_columns_can_be_requested() {
    let folder = lake();
    let folder = folder.path();
    let report = report(
        folder,
        &format!("{SIDES} --frames 1:3:2 --fields range,intensity,true_range,category_id,firing -o DIR/points.csv"),
    );
    assert_eq!((&report["frames"], &report["beams"], &report["rays"]), (&2.into(), &4.into(), &1024.into()));
    assert_eq!(report["run"]["sensors"][0]["sensor"]["kind"], "sonar");
    assert_eq!(report["run"]["sensors"][0]["sensor"]["acoustics"]["bin_m"], 0.1);
    assert_eq!(report["run"]["frames"], serde_json::json!({ "first": 1, "last": 3, "step": 2, "fps": 5.0 }));
    assert!(report["run"]["outputs"][0]["pings"].is_null());
    let points = folder.join("points.csv");
    let header = fs::read_to_string(&points).unwrap().lines().next().unwrap().to_owned();
    let mut names: Vec<&str> = header.split(',').collect();
    names.sort_unstable();
    assert_eq!(names, ["category_id", "firing", "intensity", "range", "true_range"]);
    let [range, level, truth, id, ping] =
        ["range", "intensity", "true_range", "category_id", "firing"].map(|name| csv_column(&points, name));
    assert_eq!(report["points"], range.len());
    assert!(ping.iter().all(|&ping| ping == 1.0 || ping == 3.0) && ping.contains(&3.0));
    assert!(level.iter().all(|level| (40.0..220.0).contains(level)));
    // For real echoes, the middle of a bin is at most half a bin off the truth, and the pulse adds as much again.
    let there = range.iter().zip(&truth).zip(&id).filter(|(_, id)| **id > 0.0);
    let (near, all) = there
        .fold((0, 0), |(near, all), ((range, truth), _)| (near + usize::from((range - truth).abs() < 0.15), all + 1));
    assert!(all > 100 && near as f64 > 0.98 * f64::from(all), "{near} of {all}");
    let labels = fs::read_to_string(folder.join("points.labels.json")).unwrap();
    assert!(labels.contains("\"seabed\"") && labels.contains("\"boulder\""), "{labels}");
}

#[test]
fn every_sonar_has_its_pictures() {
    let folder = lake();
    let folder = folder.path();
    let few = "--set range.max_m=20 --set acoustics.bin_m=0.1";
    let swath = format!(
        "scan DIR/lake.glb --sensor mbes_400 --set pattern.beams=32 --set pattern.rays=8 --set pattern.rate_hz=5 {few} \
         --trajectory DIR/survey.csv -o DIR/depths.csv --image DIR/map.npz --preview DIR/map.png --view track --color height"
    );
    let said = stdout(folder, &swath);
    assert!(said.contains("points of 160 beams (1,280 rays), 5 pings"), "{said}");
    // The bed is about 12 m below the surface.
    let depths = csv_column(&folder.join("depths.csv"), "z");
    assert!(depths.len() > 100 && depths.iter().filter(|z| (-14.0..-8.0).contains(*z)).count() > depths.len() * 9 / 10);
    let (_, heights) = npz_array(&folder.join("map.npz"), "values");
    let heights = heights.chunks(4).map(|value| f32::from_le_bytes(value.try_into().unwrap()));
    assert!(heights.filter(|z| (-14.0..-8.0).contains(z)).count() > 20);

    let fan = format!(
        "scan DIR/lake.glb --sensor fls_900 --set pattern.beams=32 --set pattern.rays=16 {few} --at -8,0,-8 \
         --preview DIR/fan.png --view fan --image DIR/fan_grey.png"
    );
    assert!(stdout(folder, &fan).contains("1 ping\n"));
    for name in ["map.png", "fan.png", "fan_grey.png", "fan_grey.category_id.png"] {
        assert!(is_png(&folder.join(name)), "{name}");
    }
    let ground = format!("{SIDES} --preview DIR/ground.png --view waterfall --ground");
    stdout(folder, &ground);
    stdout(folder, &format!("{SIDES} --preview DIR/slant.png --view waterfall"));
    assert_ne!(fs::read(folder.join("ground.png")).unwrap(), fs::read(folder.join("slant.png")).unwrap());
}

#[test]
fn the_seed_and_nothing_else_decides() {
    let folder = lake();
    let folder = folder.path();
    let pings = |name: &str, options: &str| {
        stdout(folder, &format!("{SIDES} --frames 0:1 {options} --pings DIR/{name}.npz"));
        npz_array(&folder.join(format!("{name}.npz")), "level").1
    };
    let one = pings("one", "--threads 1");
    assert_eq!(one, pings("two", "--threads 2"));
    assert_ne!(one, pings("other", "--seed 1"));
}

#[test]
fn what_does_not_fit_a_sonar_is_named_and_nothing_is_written() {
    let folder = lake();
    let folder = folder.path();
    fs::write(folder.join("low.yaml"), "water: {surface_z_m: -3.5}\n").unwrap();
    fs::write(folder.join("wet.yaml"), "environment: {fog: {visibility_m: 50}, water: {ph: 8}}\n").unwrap();
    fs::write(folder.join("cast.yaml"), "water: {profile: {file: cast.csv}}\n").unwrap();
    fs::write(folder.join("cast.csv"), "depth_m,speed_m_s\n0,1500\n10,15\n").unwrap();
    let before = files(folder);
    let lidar = "scan DIR/lake.glb --sensor velodyne_vlp16 --at 0,0,-2";
    let above = "scan DIR/lake.glb --sensor sss_450 --at 0,0,1 --set range.max_m=20";
    for (args, says) in [
        (
            format!("{lidar} --preview DIR/x.png --view waterfall"),
            "--view waterfall: the sensor is a lidar; allowed: top",
        ),
        (format!("{lidar} --pings DIR/x.npz"), "--pings: the sensor is a lidar; allowed: with sonars only"),
        (format!("{lidar} --image DIR/x.npz --view fan"), "--image: the sensor is a lidar; allowed: with sonars only"),
        (format!("{SIDES} --preview DIR/x.png --view track --ground"), "--ground: allowed with --view waterfall only"),
        (format!("{SIDES} --pings DIR/x.csv"), "--pings: the ending of the output file"),
        (format!("{SIDES} --pings DIR/x.kmall"), "x.kmall is for a sidescan sonar; allowed: swath sonars"),
        (
            "scan DIR/lake.glb --sensor fls_900 --at 0,0,-2 --pings DIR/x.xtf".to_owned(),
            "x.xtf is for a fan sonar; allowed: side-scan and swath sonars; .npz and .h5 hold any",
        ),
        (format!("{SIDES} --image DIR/x.npz"), "--image: writes the view of --view, which is top; allowed: waterfall"),
        (
            format!("{above} -o DIR/x.csv"),
            "error: the sonar is 1.000 m above the water, whose surface is at z = 0 m: lower it with --at",
        ),
        ("bench DIR/lake.glb --sensor sss_450 --at 0,0,1".to_owned(), "error: the sonar is 1.000 m above the water"),
        (format!("{SIDES} --env DIR/low.yaml -o DIR/x.csv"), "error: the sonar is 0.500 m above the water"),
        (format!("{SIDES} --set pattern.rate_hz=50 -o DIR/x.csv"), "range.max_m is 20 m, beyond the 1"),
        (
            format!("{SIDES} --set noise.dropout=0.1 -o DIR/x.csv"),
            "noise: is given; allowed: with other kinds than sonar",
        ),
        (format!("{SIDES} --profile paper --pings DIR/x.npz"), "--pings: --profile paper makes points and no pings"),
        (
            format!("{SIDES} --profile blainder --image DIR/x.npz --view track"),
            "--image: --profile blainder makes points and no pings; allowed: with --profile physical",
        ),
        (
            format!("{SIDES} --profile paper --preview DIR/x.png --view waterfall"),
            "--view waterfall: --profile paper makes points and no pings",
        ),
        (format!("{SIDES} --rain 3 -o DIR/x.csv"), "--rain: the sensor is a sonar, and in water there is no weather"),
        (format!("{SIDES} --dust 50,1e5,5,12 -o DIR/x.csv"), "--dust: the sensor is a sonar"),
        (format!("{SIDES} --env DIR/wet.yaml -o DIR/x.csv"), "wet.yaml: fog: the sensor is a sonar"),
        (
            format!("{SIDES} --env DIR/cast.yaml -o DIR/x.csv"),
            "cast.yaml: water.profile.file: DIR/cast.csv: line 3: speed_m_s is 15; allowed: 1300 to 1700",
        ),
        (format!("{SIDES} --returns first -o DIR/x.csv"), "--returns: the sensor is a sonar, which reports the depth"),
        (
            format!("{SIDES} --single --preview DIR/x.png --view track"),
            "--single: files and pictures of pings hold all",
        ),
        (
            format!("{SIDES} --single -o DIR/x.npz --pings DIR/x_0001.npz"),
            "x_0001.npz: is the name that --single gives to a frame of",
        ),
        (
            format!("{SIDES} --image DIR/x.png --view track --preview DIR/x.category_id.png"),
            "x.category_id.png: would be written twice",
        ),
        (
            format!("{SIDES} --preview DIR/x.png --view fan"),
            "--view fan: the sonar is a side-scan sonar, whose beams look to the sides; allowed: waterfall, track",
        ),
        (
            format!("{SIDES} --preview DIR/x.png --view track --color cause"),
            "--color cause: not available with --view track of this sonar; allowed: label, intensity",
        ),
        (
            "scan DIR/lake.glb --sensor mbes_400 --at 0,0,-2 --preview DIR/x.png --view waterfall --ground".to_owned(),
            "--ground: the sonar does not look to the sides",
        ),
    ] {
        let output = run(folder, &args);
        // The place, the simulation and the content of a file are not wrong usage.
        let failed = ["above the water", "range.max_m is 20 m", "speed_m_s is 15"].iter().any(|of| says.contains(of));
        assert_eq!(output.status.code(), Some(if failed { 1 } else { 2 }), "{args}\n{}", stderr(&output));
        let says = says.replace("DIR", &folder.display().to_string());
        assert!(stderr(&output).contains(&says), "{args}\n{}", stderr(&output));
    }
    assert_eq!(files(folder), before);
}

#[test]
fn points_of_a_sonar_have_their_causes() {
    let folder = lake();
    let folder = folder.path();
    let said = stdout(folder, &format!("{SIDES} -o DIR/points.csv -o DIR/points.las"));
    let listed = said.lines().find_map(|line| line.trim().strip_prefix("points by cause: ")).expect("causes");
    let causes = csv_column(&folder.join("points.csv"), "cause");
    let surfaces = causes.iter().filter(|&&cause| cause == 0.0).count();
    assert!(surfaces > 100 && listed.replace(',', "").contains(&format!("{surfaces} surface")), "{said}");
    assert!(listed.contains(" noise") == causes.contains(&7.0), "{said}");
    for name in ["return_number", "return_count"] {
        assert!(csv_column(&folder.join("points.csv"), name).iter().all(|&number| number == 1.0));
    }
    let output = run(folder, &format!("{SIDES} -o DIR/more.las"));
    assert!(!stderr(&output).contains("return numbers"), "{}", stderr(&output));
    // Only what was requested.
    stdout(folder, &format!("{SIDES} --frames 0:0 --fields x,y,z -o DIR/three.csv"));
    assert!(fs::read_to_string(folder.join("three.csv")).unwrap().starts_with("x,y,z\n"));
    // Lidars have the column only if it is requested.
    stdout(folder, "scan DIR/lake.glb --sensor velodyne_vlp16 --at 0,0,-2 -o DIR/light.csv");
    assert!(!fs::read_to_string(folder.join("light.csv")).unwrap().lines().next().unwrap().contains("cause"));
}

#[test]
fn a_sonar_that_receives_nothing_is_explained() {
    let folder = lake();
    let folder = folder.path();
    let deep = "scan DIR/lake.glb --sensor sss_450 --set range.max_m=20 --set pattern.rays=256 --at 0,0,-40";
    let warnings = |args: &str| report(folder, &format!("{deep} {args}"))["warnings"].to_string();
    let said = warnings("--set acoustics.detection_threshold_db=3 -o DIR/points.csv");
    assert!(said.contains("points are noise; perhaps the sonar is below the bed"), "{said}");
    assert!(said.contains("farther away than range.max_m, 20 m"), "{said}");
    let said = warnings("--preview DIR/falls.png --view waterfall");
    assert!(said.contains("nothing but noise is received; perhaps"), "{said}");
    let said = warnings("--set acoustics.detection_threshold_db=40 -o DIR/none.csv");
    assert!(said.contains("no beam has a return") && !said.contains("noise"), "{said}");
    let said = report(folder, &format!("{SIDES} -o DIR/heard.csv"))["warnings"].to_string();
    assert!(!said.contains("noise"), "{said}");
}

#[test]
fn a_velocity_log_reports_where_it_has_no_bottom() {
    let folder = lake();
    let folder = folder.path();
    let log = "scan DIR/lake.glb --sensor water_linked_a50 --set pattern.rays=256 --at 0,0,-3";
    let warnings = |args: &str| report(folder, &format!("{log} {args}"))["warnings"].to_string();
    for output in ["-o DIR/log.csv", "--pings DIR/log.npz"] {
        let said = warnings(&format!("--set range.max_m=6 {output}"));
        assert!(
            said.contains("no beam met the bottom within range.max_m, 6 m, in 1 of 1 pings: they have no"),
            "{said}"
        );
        let said = warnings(output);
        assert!(!said.contains("met the bottom"), "{said}");
        assert!(said.contains("dvl.water: nothing scatters in the layer"), "{said}");
    }
    let speeds = csv_column(&folder.join("log.csv"), "bottom_track_x");
    assert!(speeds.len() == 4 && speeds.iter().all(|speed| speed.abs() < 0.02), "{speeds:?}");
    let (shape, _) = npz_array(&folder.join("log.npz"), "bottom_track_radial");
    assert_eq!(shape, [1, 4]);
    fs::write(folder.join("water.yaml"), "water: {volume_backscatter_db: -70, current_m_s: [1, 0, 0]}\n").unwrap();
    let said = warnings("--set dvl.water.sigma_m_s=0 --env DIR/water.yaml -o DIR/log.csv");
    assert!(!said.contains("dvl.water"), "{said}");
    let speeds = csv_column(&folder.join("log.csv"), "water_track_x");
    assert!(speeds.iter().all(|speed| (speed + 1.0).abs() < 0.01), "{speeds:?}");
}

#[test]
fn files_beside_an_image_are_reported() {
    let folder = lake();
    let folder = folder.path();
    let report = report(folder, &format!("{SIDES} --frames 0:1 --image DIR/map.png --view track"));
    let outputs: Vec<_> = report["outputs"].as_array().unwrap().iter().map(|file| file.as_str().unwrap()).collect();
    assert_eq!(
        outputs,
        ["map.png", "map.category_id.png", "map.part_id.png", "map.instance_id.png"]
            .map(|name| folder.join(name).display().to_string())
    );
    assert!(outputs.iter().all(|file| is_png(Path::new(file))));
    // Labels that were requested and those that the picture shows, whether files of pings have them or not.
    for pings in ["", " --pings DIR/pings.npz"] {
        let command_line =
            format!("{SIDES} --frames 0:1 --image DIR/b.npz --view track --fields x,instance_id,material_id{pings}");
        stdout(folder, &command_line);
        let held = fs::read(folder.join("b.npz")).unwrap();
        let has = |name: &str| held.windows(name.len()).any(|found| found == name.as_bytes());
        assert!(
            ["category_id", "part_id", "instance_id", "material_id"].iter().all(|name| has(&format!("{name}.npy")))
        );
        assert!(!has("range.npy"));
    }
}

#[test]
fn a_sonar_is_benched_in_its_water() {
    let folder = lake();
    let folder = folder.path();
    fs::write(folder.join("high.yaml"), "water: {surface_z_m: 2}\n").unwrap();
    let report = report(
        folder,
        "bench DIR/lake.glb --sensor sss_450 --set range.max_m=20 --set pattern.rays=64 --at 0,0,1 --env DIR/high.yaml",
    );
    assert_eq!((&report["beams"], &report["rays"]), (&2.into(), &128.into()));
}
