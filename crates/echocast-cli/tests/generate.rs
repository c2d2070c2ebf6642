//! Scenes that the program makes.

mod common;

use common::{files, run, stderr, stdout};
use std::fs;

#[test]
fn a_lake_bed_is_made_and_scanned() {
    let folder = tempfile::tempdir().unwrap();
    let said = stdout(folder.path(), "generate seabed --size 20,20 --cell 0.5 --boulders 5 --seed 3 -o DIR/lake.glb");
    for words in ["5 boulder", "1 wreck", "60 fish", "20 x 20 m", "camera Sonar", "animation Swarm", "lake.glb"] {
        assert!(said.contains(words), "{words}\n{said}");
    }
    let quiet = "generate seabed --size 20,20 --cell 0.5 --boulders 5 --seed 3 -q -o DIR/again.glb";
    assert_eq!(stdout(folder.path(), quiet), "");
    let [lake, again] = ["lake.glb", "again.glb"].map(|name| fs::read(folder.path().join(name)).unwrap());
    assert_eq!(lake, again);

    let info = stdout(folder.path(), "info DIR/lake.glb");
    // Of the bed, boulders, the wreck and fish: 3200 + 5 * 320 + 40 + 60 * 80.
    assert!(said.contains("9,640 triangles") && info.contains("9,640"), "{info}");
    assert!(info.contains("Sonar") && info.contains("gravel"), "{info}");
    assert!(info.contains("animations  1\n  Swarm ") && info.contains(" s\n"), "{info}");
    let chosen = stdout(folder.path(), "info DIR/lake.glb --animation Swarm --loop");
    assert_eq!(chosen, info);
    let wrong = run(folder.path(), "info DIR/lake.glb --animation swam");
    assert!(stderr(&wrong).contains("there is no animation named \"swam\"; near: Swarm"), "{}", stderr(&wrong));
    let scan =
        "scan DIR/lake.glb --sensor velodyne_vlp16 --at 0,0,-2 --rpy 0,90,0 -o DIR/lake.csv --preview DIR/lake.png";
    assert!(stdout(folder.path(), scan).contains("points of"));
}

#[test]
fn a_street_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let said = stdout(folder.path(), "generate street --cars 3 --seconds 8 --seed 3 -o DIR/street.glb");
    for words in ["2 person", "4 sidewalk", "200 m", "animation Street: 8 s, 3 cars", "camera Lidar", "street.glb"] {
        assert!(said.contains(words), "{words}\n{said}");
    }
    assert_eq!(stdout(folder.path(), "generate street --cars 3 --seconds 8 --seed 3 -q -o DIR/again.glb"), "");
    let [street, again] = ["street.glb", "again.glb"].map(|name| fs::read(folder.path().join(name)).unwrap());
    assert_eq!(street, again);
    let drive = "scan DIR/street.glb --sensor velodyne_vlp16 --camera Lidar --frames 0:2 -o DIR/drive.csv";
    assert!(stdout(folder.path(), drive).contains("3 frames"));
}

#[test]
fn a_landscape_is_made_and_scanned() {
    let folder = tempfile::tempdir().unwrap();
    let args = "generate landscape --size 40,30 --cell 1 --trees-per-ha 100 --grass-per-m2 1 --seed 3";
    let said = stdout(folder.path(), &format!("{args} -o DIR/forest.glb"));
    for words in ["12 tree", "1 path", "40 x 30 m", "stream of", "cameras Lidar, Overview", "forest.glb"] {
        assert!(said.contains(words), "{words}\n{said}");
    }
    assert_eq!(stdout(folder.path(), &format!("{args} -q -o DIR/again.glb")), "");
    let [forest, again] = ["forest.glb", "again.glb"].map(|name| fs::read(folder.path().join(name)).unwrap());
    assert_eq!(forest, again);
    let scan = "scan DIR/forest.glb --sensor velodyne_vlp16 --camera Lidar -o DIR/forest.csv";
    assert!(stdout(folder.path(), scan).contains("points of"));

    fs::write(folder.path().join("a.asc"), "ncols 3\nnrows 3\ncellsize 10\n1 2 3\n4 5 6\n7 8 9.5\n").unwrap();
    let said = stdout(folder.path(), "generate landscape --preset paper --height-map DIR/a.asc -o DIR/map.glb");
    assert!(said.contains("20 x 20 m, 1.0 to 9.5 m high, 2 x 2 cells") && !said.contains("path"), "{said}");
}

#[test]
fn a_town_and_rooms_are_made() {
    let folder = tempfile::tempdir().unwrap();
    let said = stdout(folder.path(), "generate street --blocks 2,1 --people 5 --seed 7 -o DIR/town.glb");
    for words in ["town of 2 x 1 blocks", "6 crossings", "12 cars drive", "5 person", "traffic-sign", "lane-marking"] {
        assert!(said.contains(words), "{words}\n{said}");
    }
    let said = stdout(folder.path(), "generate indoor --rooms 3,1 --seed 7 -o DIR/flat.glb");
    for words in ["3 x 1 rooms", "mirrors: 2, panes: 1", "3 floor", "camera Scanner"] {
        assert!(said.contains(words), "{words}\n{said}");
    }
    let scan = "scan DIR/flat.glb --sensor velodyne_vlp16 --camera Scanner -o DIR/flat.csv";
    assert!(stdout(folder.path(), scan).contains("points of"));
    let harbour =
        "generate seabed --size 20,20 --ripples 0.8,0.05,30 --pipes 1 --mines 3 --seagrass 2 -o DIR/harbour.glb";
    let said = stdout(folder.path(), harbour);
    for words in ["1 pipe", "3 mine", "seagrass", "ripples 0.05 m high every 0.8 m"] {
        assert!(said.contains(words), "{words}\n{said}");
    }
}

#[test]
fn what_is_wrong_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("old.glb"), "old").unwrap();
    for (args, code, says) in [
        ("", 2, "seabed"),
        ("seabed", 2, "--output"),
        ("seabed --size 3 -o DIR/x.glb", 2, "two numbers"),
        ("seabed --fish -1 -o DIR/x.glb", 2, "--fish"),
        ("seabed --size -3,4 -o DIR/old.glb", 2, "--size is -3; allowed: 1 to 10000"),
        ("seabed --depth -5 -o DIR/old.glb", 2, "--depth is -5"),
        ("seabed --cell 0.001 -o DIR/x.glb", 2, "--cell is 0.001; allowed: 0.0220 to 40: a bed of 60 x 40 m"),
        ("seabed --ripples 0.6,0.05 --cell 0.4 -o DIR/x.glb", 2, "--ripples LENGTH is 0.6; allowed: 1.200 or more"),
        ("seabed --ripples 0.6,0.4 -o DIR/x.glb", 2, "--ripples HEIGHT is 0.4"),
        ("street --cars 11 -o DIR/old.glb", 2, "--cars is 11; allowed: 1 to 10"),
        ("street --blocks 3 -o DIR/x.glb", 2, "two whole numbers"),
        ("street --blocks 0,3 -o DIR/x.glb", 2, "--blocks is 0; allowed: 1 to 10"),
        ("indoor --room-size 2,3 -o DIR/x.glb", 2, "--room-size is 2; allowed: 3 to 20"),
        ("indoor --furniture 2 -o DIR/x.glb", 2, "--furniture is 2"),
        ("seabed --ripples 0.6,0.05,500 -o DIR/x.glb", 2, "--ripples DIRECTION is 500; allowed: -360 to 360"),
        ("seabed --ripples 0.6 -o DIR/x.glb", 2, "two or three numbers"),
        ("street --seconds 3 -o DIR/x.glb", 2, "--seconds is 3; allowed: 8 to 30"),
        ("landscape --size 5,50 -o DIR/x.glb", 2, "--size is 5; allowed: 10 to 10000"),
        ("landscape --trees-per-ha 9e9 -o DIR/old.glb", 2, "--trees-per-ha is 9000000000; allowed: 0 to 5000"),
        ("landscape --height-map DIR/old.glb -o DIR/x.glb", 1, "old.glb: not a height map; allowed: a PNG of 16 bits"),
        ("landscape --height-range 1,2 -o DIR/x.glb", 2, "--height-map"),
        ("landscape --preset papers -o DIR/x.glb", 2, "paper"),
        ("seabed -o DIR/x.obj", 2, "written as .glb"),
        ("seabed -o DIR/no/x.glb", 1, "no/x.glb: No such file"),
    ] {
        let output = run(folder.path(), &format!("generate {args}"));
        assert_eq!(output.status.code(), Some(code), "{args}");
        assert!(stderr(&output).contains(says), "{args}\n{}", stderr(&output));
    }
    assert_eq!(files(folder.path()), ["old.glb"]);
    assert_eq!(fs::read_to_string(folder.path().join("old.glb")).unwrap(), "old");
}
