//! Sets of samples, scenario files and generated scenes, looked at by a browser and by third-party readers.

use echocast::generate::{GeneratedScene, Indoor, Landscape, Seabed, Street};
use echocast::scenario::set::{self, RunOptions};
use echocast::{Error, Scenario};
use echocast_tests::{python, root};
use serde_json::Value;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Makes all samples of `text`, a scenario whose files are in `folder`, in its folder `set`.
fn make(folder: &Path, text: &str) -> PathBuf {
    let scenario = Scenario::from_yaml(text, folder).unwrap();
    let set = folder.join("set");
    let options = RunOptions::default().folder(set.clone()).samples(None).shard(None).resume(false).threads(0);
    let summary = set::run(scenario, &options, &|_| ()).unwrap();
    assert!(summary.complete && summary.failed.is_empty(), "{:?}", summary.failed);
    set
}

/// What a script of `tests/readers` prints, given `args` and `input`.
fn read<S: AsRef<OsStr>>(script: &str, args: &[S], input: &Value) -> Value {
    let script = root().join("tests/readers").join(script);
    let mut child = python()
        .arg(&script)
        .args(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // One that does not read its input may have ended.
    let _ = child.stdin.take().unwrap().write_all(input.to_string().as_bytes());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}: {}", script.display(), String::from_utf8_lossy(&output.stderr));
    let said = String::from_utf8(output.stdout).unwrap();
    if said.is_empty() { Value::Null } else { serde_json::from_str(&said).unwrap() }
}

fn list(value: &Value) -> &[Value] {
    value.as_array().unwrap_or_else(|| panic!("{value} is no list"))
}

/// Chromium or Chrome; `None` on Ubuntu without Chrome, whose Chromium is a snap that cannot see the files of tests.
fn browser() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = || std::env::split_paths(&path).filter(|folder| !folder.starts_with("/snap"));
    let mut all = ["chromium", "google-chrome"].into_iter().flat_map(|name| folders().map(move |it| it.join(name)));
    let found = all.find(|path| path.is_file());
    let ubuntu = || fs::read_to_string("/etc/os-release").is_ok_and(|system| system.contains("\nID=ubuntu"));
    assert!(found.is_some() || ubuntu(), "there is no chromium on the PATH: run scripts/setup --test");
    found
}

/// What `browser`, without a network, shows of the page `html`, and what went wrong, by `readers/page.js`.
fn shown(browser: &Path, html: &str) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("page.html");
    let script = include_str!("readers/page.js");
    assert_eq!(html.matches("<title>").count(), 1);
    fs::write(&page, html.replace("<title>", &format!("<script>{script}</script>\n<title>"))).unwrap();
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--host-resolver-rules=MAP * ~NOTFOUND",
        ])
        .args(["--enable-logging=stderr", "--v=0", "--dump-dom"])
        .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
        .arg(format!("file://{}", page.display()))
        .env("HOME", folder.path())
        .output()
        .unwrap();
    let [dom, log] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    let found = dom.split_once("<body>").and_then(|(_, rest)| rest.split_once("</body>"));
    let (found, _) = found.unwrap_or_else(|| panic!("{}: {log}", browser.display()));
    let found = found.replace("&lt;", "<").replace("&gt;", ">").replace("&nbsp;", "\u{a0}").replace("&amp;", "&");
    let mut found: Value = serde_json::from_str(&found).unwrap_or_else(|error| panic!("{error}: {found}"));
    found["console"] = log.lines().filter(|line| line.contains(":CONSOLE")).collect();
    found
}

/// What is wrong with the pictures of a page, that should be of `sizes`, and what its browser complains about.
fn faults(found: &Value, sizes: &[[u32; 2]]) -> Vec<String> {
    let pictures = list(&found["pictures"]);
    let mut all = Vec::new();
    if pictures.len() != sizes.len() {
        all.push(format!("{} pictures of {}", pictures.len(), sizes.len()));
    }
    let wrong = |(k, (picture, size)): (usize, (&Value, &[u32; 2]))| {
        let right = picture["size"] == serde_json::json!(size) && picture["whole"] == true;
        (!right).then(|| format!("picture {k} is {picture}"))
    };
    all.extend(pictures.iter().zip(sizes).enumerate().filter_map(wrong));
    let told = ["faults", "fetched", "console"].into_iter().flat_map(|key| list(&found[key]));
    all.extend(told.map(|fault| fault.as_str().unwrap().to_owned()));
    all
}

#[test]
fn a_browser_shows_the_report() {
    let Some(browser) = browser() else {
        eprintln!("not tested: there is no google-chrome on the PATH");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    // One category is called like a script.
    let text = "scene: {generate: {indoor: {rooms: [1, 1]}, seed: 7}, labels: {objects: \
                {\"Wall_*\": \"Tür & <img src=x onerror='no'>\", \"Floor_*\": floor}}}\n\
                sensors: [{sensor: velodyne_vlp16}]\ntrajectory: {camera: Scanner}\nsamples: 3\n\
                variation: [{set: environment.fog.visibility_m, to: {uniform: [80, 500]}}]\n";
    let set = make(folder.path(), text);
    let html = fs::read_to_string(set.join("report.html")).unwrap();
    let report: Value = serde_json::from_slice(&fs::read(set.join("report.json")).unwrap()).unwrap();
    // Width and height are in the first chunk of a PNG.
    let number = |bytes: &[u8]| u32::from_be_bytes(bytes.try_into().unwrap());
    let sizes: Vec<[u32; 2]> = (0..3)
        .map(|sample| fs::read(set.join(format!("pictures/{sample:06}.png"))).unwrap())
        .map(|picture| [number(&picture[16..20]), number(&picture[20..24])])
        .collect();

    let found = shown(&browser, &html);
    assert_eq!(faults(&found, &sizes), [""; 0]);
    let rows = list(&found["categories"]).iter().map(|row| {
        let text = |cell: usize| row[cell].as_str().unwrap();
        (text(0).to_owned(), text(1).replace(',', "").parse().unwrap())
    });
    let counts: BTreeMap<String, u64> = serde_json::from_value(report["categories"].clone()).unwrap();
    assert_eq!(rows.collect::<BTreeMap<_, u64>>(), counts);
    assert!(counts.len() > 2 && counts.keys().any(|name| name.starts_with("Tür & <img")), "{counts:?}");
    assert_eq!(found["drawn"][0][0], "set environment.fog.visibility_m");

    // What would be wrong is noticed: a picture that ends early, one that is none, a script, something from elsewhere.
    let digits = html.find("base64,").unwrap() + 7;
    let end = digits + html[digits..].find('"').unwrap();
    let short = digits + (end - digits) / 8 * 4;
    let broken = format!("{}{}", &html[..short], &html[end..]);
    let other =
        "<img src=\"data:image/png;base64,AAAA\"><img src=\"http://example.com/a.png\"><script>nothing()</script>";
    let found = shown(&browser, &broken.replace("</body>", &format!("{other}</body>")));
    let said = faults(&found, &sizes);
    for words in [
        "5 pictures of 3",
        "picture 0 is",
        "cannot load data:image/png;base64,AAAA",
        "cannot load http://example.com/a.p",
        "http://example.com/a.png",
        "Uncaught ReferenceError: nothing is not defined",
        ":CONSOLE",
    ] {
        assert!(said.iter().any(|fault| fault.contains(words)), "{words}: {said:?}");
    }
}

/// What stands on a floor and on a hill is placed by `drawn` of the samples alone, and measured by trimesh and FCL.
#[test]
fn what_is_placed_stands_and_overlaps_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    read("placed.py", &[OsStr::new("make"), folder.as_os_str()], &Value::Null);
    let text = r#"
scene: {files: room.glb}
sensors:
  - sensor: {name: eye, kind: lidar, pattern: {type: pinhole, resolution: [400, 200], fov_deg: [45, 80]}}
trajectory: {position_m: [8, 0, 25], rpy_deg: [0, 90, 0]}
samples: 8
seed: 5
variation:
  - move: "Chair_*"
    to: {within: {min_m: [-8, -8, 0], max_m: [8, 8, 0]}}
    turn_deg: {uniform: [0, 360]}
    scale: {uniform: [0.8, 1.2]}
    clearance_m: 0.3
  - {move: "Chair_*", name: nudge, by_m: [{uniform: [-1, 1]}, 0, 0], turn_deg: {normal: [0, 20]}, clearance_m: 0.1}
  - place: models
    call: clear
    count: 6
    at: {on: Floor}
    turn_deg: {uniform: [0, 360]}
    scale: {uniform: [0.8, 1.2]}
    clearance_m: 0.15
  - {place: models, call: line, count: 3, at: {along: [[-9, -9, 0], [9, -6, 0]]}, turn_deg: 30}
  - place: models
    call: aligned
    count: 6
    at: {on: Hill}
    align: slope
    turn_deg: {uniform: [0, 360]}
    clearance_m: 0.1
  - {place: models, call: upright, count: 6, at: {on: Hill}, turn_deg: {uniform: [0, 360]}, clearance_m: 0.1}
  - {place: models, call: fallen, count: 8, at: {within: {min_m: [-9, -9, 5], max_m: [28, 9, 8]}}, drop: true}
  - {place: models, call: loose, count: 6, at: {within: {min_m: [-4, -4, 0], max_m: [4, 4, 0]}}, overlap: true}
"#;
    let set = make(folder, text);
    let rows = read("placed.py", &[OsStr::new("measure"), folder.as_os_str(), set.as_os_str()], &Value::Null);
    let mut points: BTreeMap<&str, u64> = BTreeMap::new();
    let mut overlaps = 0;
    for row in list(&rows) {
        let number = |key: &str| row[key].as_f64().unwrap_or_else(|| panic!("{key} of {row}"));
        let rule = row["rule"].as_str().unwrap();
        let (on_slope, least_away) = match rule {
            "nudge" => (false, 0.1),
            "place clear" => (false, 0.15),
            "place line" => (false, 0.0),
            "place aligned" | "place upright" => (true, 0.1),
            // The lowest 2 cm may reach into what is there.
            "place fallen" => (true, -0.02),
            _ => (false, f64::NEG_INFINITY),
        };
        // The scan saw it where it is said to be.
        assert!(number("missed_m") < 1e-4, "{row}");
        *points.entry(rule).or_default() += row["points"].as_u64().unwrap();
        assert!(number("foot_m").abs() < 1e-3, "{row}");
        if rule == "place aligned" {
            assert!(number("tilt_deg") < 0.01 && number("sunk_m") < 0.02, "{row}");
        } else {
            assert!(number("lowest_m").abs() < 1e-3, "{row}");
            // An upright box on a slope reaches into it by half of its diagonal, which is at most 0.8 m here.
            let most = if on_slope { 0.02 + 0.8 * number("tilt_deg").to_radians().tan() } else { 1e-3 };
            assert!(number("sunk_m") < most, "{row}");
        }
        let away = row["away_m"].as_f64().unwrap_or(f64::INFINITY);
        assert!(away >= least_away, "{row}");
        overlaps += usize::from(away < 0.0);
    }
    assert!(points.len() == 7 && points.values().all(|&points| points > 500), "{points:?}");
    // Those that may overlap do, and that is seen.
    assert!(overlaps > 5, "{overlaps}");
}

/// Sets of a street, read as their users do.
#[test]
fn sets_are_read_by_their_users() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = r#"
scene: {generate: {street: {cars: 6, people: 4}, seed: 7}}
sensors:
  - {name: top, sensor: velodyne_vlp16}
  - name: front
    sensor: {name: front, kind: lidar, pattern: {type: pinhole, resolution: [160, 90], fov_deg: [90, 58.7]}}
    mount: {position_m: [0.3, 0, -0.1]}
trajectory: {camera: Lidar}
frames: {last: 5, fps: 10}
samples: 5
seed: 2
set: {splits: {train: 60, held-back: 40}}
outputs: [{style: kitti, frames: 6}, {style: nuscenes}, {style: webdataset, samples: 2}]
variation:
  - {move: "Tree_*", by_m: [{uniform: [-1, 1]}, 0, 0], chance: 0.5}
"#;
    let set = make(folder, text);
    let looked = |style: &str| read("sets.py", &[OsStr::new(style), set.join(style).as_os_str()], &Value::Null);

    let kitti = looked("kitti");
    assert_eq!(kitti["frames"], 30);
    let objects = |of: &str| kitti["objects"][of].as_u64().unwrap();
    assert!(objects("Car") >= 100 && objects("Truck") >= 30 && objects("Pedestrian") >= 5, "{kitti}");
    // What drives is elsewhere when the camera sees it than when the LiDAR meets it; of what stands, only what leans is.
    let count = |of: &str| kitti[of].as_u64().unwrap();
    assert!(count("standing") > 50 && count("standing_leaning") * 5 < count("standing"), "{kitti}");
    assert!(kitti["points_in_boxes"].as_u64().unwrap() > 2000 && kitti["truncated"].as_u64().unwrap() > 0, "{kitti}");
    // Cityscapes' road, building, vegetation, person, car and truck.
    for class in ["7", "11", "21", "24", "26", "27"] {
        assert!(kitti["pixels"][class].as_u64().unwrap() > 10, "{class}: {kitti}");
    }

    let nuscenes = looked("nuscenes");
    let counts = &nuscenes["counts"];
    assert_eq!((&counts["scene"], &counts["sample"], &counts["sample_data"]), (&5.into(), &10.into(), &60.into()));
    assert_eq!((&counts["lidarseg"], &counts["category"]), (&10.into(), &32.into()));
    assert_eq!(nuscenes["channels"], serde_json::json!(["CAM_FRONT", "LIDAR_TOP"]));
    for class in ["vehicle.car", "vehicle.truck", "human.pedestrian.adult", "flat.driveable_surface", "static.manmade"]
    {
        assert!(nuscenes["classes"][class].as_u64().unwrap() > 10, "{nuscenes}");
    }
    let speed = |attribute: &str, end: usize| nuscenes["speeds"][attribute][end].as_f64().unwrap();
    assert!(speed("vehicle.parked", 1) < 0.1 && speed("vehicle.moving", 1) > 3.0, "{nuscenes}");
    assert!(nuscenes["pictured"].as_u64().unwrap() > 10, "{nuscenes}");
    assert_eq!(nuscenes["own_splits"], serde_json::json!(["held-back"]));

    // Samples are in the archives of their parts.
    let parts = ["train", "held-back"].map(|part| {
        let listed = fs::read_to_string(set.join(format!("splits/{part}.txt"))).unwrap();
        listed.lines().map(|line| line.parse::<u64>().unwrap()).collect::<Vec<_>>()
    });
    let archives = looked("webdataset");
    for (part, samples) in ["train", "held-back"].into_iter().zip(&parts) {
        let found = (0..).map_while(|index| archives[format!("{part}-{index:06}.tar")].as_array());
        let found: Vec<u64> = found.flatten().map(|sample| sample.as_u64().unwrap()).collect();
        assert_eq!(found, *samples);
    }
    assert_eq!(parts.concat().len(), 5);
}

/// What the schema says against each of `texts`.
fn against(texts: &[String]) -> Vec<Vec<String>> {
    let schema = root().join("presets/scenario.schema.json");
    serde_json::from_value(read("schema.py", &[schema], &texts.into())).unwrap()
}

const SCENE: &str = "scene: {files: a.glb}\nsensors: [{sensor: velodyne_vlp16}]\n";

#[test]
fn the_schema_accepts_what_is_read() {
    let mut texts: Vec<(String, PathBuf)> = Vec::new();
    for entry in fs::read_dir(root().join("examples/scenarios")).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            continue; // of models
        }
        texts.push((fs::read_to_string(&path).unwrap(), path.parent().unwrap().to_owned()));
    }
    let page = fs::read_to_string(root().join("docs/scenario.md")).unwrap();
    let blocks = page.split("```yaml\n").skip(1).map(|rest| rest.split("```").next().unwrap());
    texts.extend(blocks.map(|block| (block.to_owned(), PathBuf::new())));
    assert!(texts.len() >= 3);
    for rest in [
        "trajectory: {poses: [[0, 0, 0, 1, 0, 0, 0, 1], [1, 1, 0, 1, 0, 0, 0, 1]]}\nframes: {last: 9, fps: 10}\n",
        "trajectory: {position_m: [0, 0, 1.8], orientation_xyzw: [0, 0, 0, 1]}\nfields: [default, \
         velocity]\norder: time\n",
        "trajectory: {on: \"Floor\", turn_deg: {uniform: [[-5, -5, 0], [5, 5, 360]]}, align: slope, tries: 5}\n",
        "environment: {rain: {rate_mm_h: 5}}\nset: {folder: out}\noutputs: [{style: plain, format: las, \
         preview: {view: top}}]\n",
        "set: {splits: 80/10/10, licence: CC-BY-4.0}\noutputs: [{style: kitti, velodyne: top, camera: eye, frames: 4, \
         types: {bench: Misc}, classes: {bench: static}}]\n",
        "set: {splits: {train: 80, test: 20.5}}\noutputs: [{style: nuscenes, version: v1.0-mini, top: top, categories: \
         {bench: static.bench}}, {style: webdataset, format: las, samples: 100}]\n",
        "trajectory: {object: Car_1}\noutputs: [{style: files, files: [a.csv, b.las], single: true, boxes: \
         boxes.json}]\n",
        "variation: [{set: \"sensors[0].rate_hz\", to: {choice: [5, {value: 10, weight: 3}]}}]\n",
        "variation: [{set: frames, to: {grid: [{last: 1}, {last: 2}]}}]\n",
        "variation: [{remove: {object: \"Tree_*\", part: bark}, chance: {truncated_normal: [0.5, 0.1, 0, 1]}}]\n",
        "variation: [{swap: Tree, with: {value: a.glb, weight: 2}, fit: true}, {swap: {category: car}, with: \
         [a.glb]}]\n",
        "variation: [{move: Car, by_m: {normal: [[0, 0, 0], [1, 1, 0]]}, turn_deg: {sobol: [0, 360]}, scale: \
         [1, 1, 2]}]\n",
        "variation: [{move: Car, to: {along: [[0, 0, 0], [9, 0, 0]], height_m: 1}, otherwise: fail, tries: 7}]\n",
        "variation: [{place: [a.glb], at: {within: {min_m: [0, 0, 0], max_m: [9, 9, 9]}}, count: {uniform: \
         [2, 5]}, drop: true}]\n",
        "variation: [{place: a.glb, at: {on: {part: grass}, steepest_deg: 20}, align: slope, overlap: true, \
         call: tuft}]\n",
        "variation: [{look: \"Wood*\", color: {choice: [[1, 0, 0], [0, 1, 0]]}, wetness: {log_uniform: [0.1, \
         1]}, dirt: 0.1}]\n",
        "variation: [{look: Wood, of: Chair, texture: {choice: [a.png, b.png]}, reflectance: {uniform: [0.1, 0.7]}}]\n",
    ] {
        texts.push((format!("{SCENE}{rest}"), PathBuf::new()));
    }
    texts.push((
        "scene: {generate: {street: {cars: 6}, seed: 7}, hide: [\"Tree_*\"], materials: {\"Wall*\": \
         {reflectance: 0.3}}, place: [{model: car.glb, at: {position_m: [3, 0, 0], rpy_deg: [0, 0, 90]}, scale: 1, \
         name: parked, category: car}]}\n\
         sensors: [{sensor: {name: a, kind: lidar, pattern: {type: pinhole, resolution: [1, 1], fov_deg: [1, 1]}}, \
         set: {noise.range_sigma_m: 0.01}, mount: {position_m: [0, 0, 1]}, rate_hz: 5, start_s: 0.1}]\n"
            .to_owned(),
        PathBuf::new(),
    ));
    let said = against(&texts.iter().map(|(text, _)| text.clone()).collect::<Vec<_>>());
    let mut faults = Vec::new();
    for ((text, folder), said) in texts.iter().zip(said) {
        faults.extend((!said.is_empty()).then(|| format!("the schema refuses {text}{said:?}")));
        // Of names of files, only those of the examples are there.
        let read = Scenario::from_yaml(text, folder);
        let wrong = read.err().filter(|error| !matches!(error, Error::Io { .. }));
        faults.extend(wrong.map(|error| format!("echocast refuses {text}{error}")));
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn the_schema_refuses_what_cannot_be_read() {
    let wrong = [
        "zzz: 1\n",
        "samples: many\n",
        "samples: 0\n",
        "seed: -1\n",
        "profile: [paper]\n",
        "frames: {first: 0, last: 1.5}\n",
        "trajectory: {position_m: [0, 0]}\n",
        "trajectory: {file: a.txt, camera: Lidar}\n",
        "trajectory: {on: Floor, clearance_m: -1}\n",
        "trajectory: {on: Floor, height_m: [1, 2, 3]}\n",
        "trajectory: {on: Floor, tries: 0}\n",
        "trajectory: {on: Floor, steepest_deg: 90}\n",
        "variation: [{place: a.glb, at: {on: Floor, steepest_deg: 90}}]\n",
        "outputs: {style: plain}\n",
        "outputs: [{style: semantic_kitti, format: las}]\n",
        "outputs: [{style: kitti, frames: 0}]\n",
        "outputs: [{style: kitti, classes: {bench: Misc}}]\n",
        "outputs: [{style: nuscenes, version: a/b}]\n",
        "outputs: [{style: webdataset, samples: 0}]\n",
        "set: {splits: 80}\n",
        "set: {splits: 80/-10}\n",
        "set: {splits: {a: -1}}\n",
        "set: {license: MIT}\n",
        "variation: [{move: Car, by_m: [1, 2]}]\n",
        "variation: [{move: Car, by_m: [{uniform: [a, 1]}, 0, 0]}]\n",
        "variation: [{move: Car, turn_deg: {uniform: [0, 90, 180]}}]\n",
        "variation: [{move: Car, turn_deg: {uniform: [0, [90]]}}]\n",
        "variation: [{move: Car, turn_deg: {uniform: [0, 90], normal: [0, 1]}}]\n",
        "variation: [{move: Car, turn_deg: {gaussian: [0, 90]}}]\n",
        "variation: [{move: Car, turn_deg: {truncated_normal: [0, 90]}}]\n",
        "variation: [{move: Car, align: down}]\n",
        "variation: [{move: {colour: red}}]\n",
        "variation: [{remove: Car, move: Car}]\n",
        "variation: [{remove: Car, chance: often}]\n",
        "variation: [{swap: Car}]\n",
        "variation: [{place: a.glb}]\n",
        "variation: [{place: [{value: a.glb, weight: 0}], at: {on: Floor}}]\n",
        "variation: [{place: a.glb, at: {on: Floor}, count: [1, 2, 3]}]\n",
        "variation: [{place: a.glb, at: {along: [[0, 0, 0]]}}]\n",
        "variation: [{look: Wood, reflectance: {choice: []}}]\n",
        "variation: [{set: samples}]\n",
    ];
    let wrong: Vec<String> = wrong.iter().map(|rest| format!("{SCENE}{rest}")).collect();
    let mut faults = Vec::new();
    for (text, said) in wrong.iter().zip(against(&wrong)) {
        faults.extend(said.is_empty().then(|| format!("the schema accepts {text}")));
        // Outputs are read when they are needed.
        let accepted = Scenario::from_yaml(text, "").is_ok() && !text.contains("outputs");
        faults.extend(accepted.then(|| format!("echocast accepts {text}")));
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Another reader finds what the generators say they have made, all with a category.
#[test]
fn generated_scenes_are_read_by_others() {
    let folder = tempfile::tempdir().unwrap();
    let made: Vec<GeneratedScene> = vec![
        Landscape::default().size_m([30.0, 20.0]).cell_m(1.0).scene(3).unwrap(),
        Street::default().people(2).scene(3).unwrap(),
        Indoor::default().scene(3).unwrap(),
        Seabed::default().cell_m(0.5).pipes(1).mines(3).seagrass(2).scene(3).unwrap(),
    ];
    let files: Vec<PathBuf> = (0..made.len()).map(|k| folder.path().join(format!("{k}.glb"))).collect();
    made.iter().zip(&files).for_each(|(scene, file)| scene.write(file).unwrap());
    let found = read("scenes.py", &files, &Value::Null);
    for (scene, found) in made.iter().zip(list(&found)) {
        assert_eq!((found["triangles"].as_u64(), &found["finite"]), (Some(scene.triangles as u64), &true.into()));
        let mut counts: BTreeMap<&str, u64> = BTreeMap::new();
        for object in list(&found["objects"]) {
            assert_ne!(object[0], "");
            *counts.entry(object[1].as_str().unwrap()).or_default() += object[2].as_u64().unwrap();
        }
        assert_eq!(counts, scene.categories.iter().map(|&(name, count)| (name, count as u64)).collect());
    }
}
