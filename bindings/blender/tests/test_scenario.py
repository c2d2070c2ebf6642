"""Scenarios whose scene is a file of Blender, run by the program, which starts Blender."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import bpy
import echocast as ec
import echocast_blender
import numpy as np
import pytest
from test_motion import straighten

KEYS: "dict[str, Any]" = {
    "scene": {"blend": "scene.blend"},
    "sensors": [{"name": "top", "sensor": "velodyne_vlp16", "set": {"noise": {"range_sigma_m": 0}}}],
    "trajectory": {"camera": "Top"},
    "frames": {"first": 0, "last": 2, "fps": 10},
    "samples": 2,
    "seed": 3,
    "variation": [{"name": "aside", "move": "Van", "by_m": [0, {"uniform": [-1, 1]}, 0]}],
    "outputs": [{"style": "plain", "format": "npz"}],
}


@pytest.fixture
def folder(tmp_path: Path, empty_scene: None) -> Path:
    """A wall that moves away at 5 m/s, a van, and a sensor that moves at 2 m/s, in scene.blend; and drive.json."""
    timeline = bpy.context.scene
    timeline.render.fps, timeline.frame_start, timeline.frame_end = 25, 0, 25
    bpy.ops.mesh.primitive_cube_add(size=4, location=(20, 0, 2))
    wall = bpy.context.object
    wall.name = "Wall"
    bpy.ops.mesh.primitive_cube_add(size=2, location=(0, 6, 1))
    bpy.context.object.name = "Van"
    timeline.cursor.location = (0, 0, 1.8)
    bpy.ops.echocast.add_sensor(preset="velodyne_vlp16")
    sensor = bpy.context.object
    sensor.name = "Top"
    for thing, speed in ((wall, 5.0), (sensor, 2.0)):
        begin = thing.location.x
        for frame in (0, 100):
            thing.location.x = begin + speed * frame / 25
            thing.keyframe_insert("location", frame=frame)
    straighten()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    (tmp_path / "drive.json").write_text(json.dumps(KEYS))
    return tmp_path


def program(folder: Path, *arguments: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    """The program, which starts this Blender."""
    python = sys.executable if not bpy.app.binary_path else "/usr/bin/python3"
    paths = [str(Path(echocast_blender.__file__).parents[1]), str(Path(ec.__file__).parents[1])]
    blender = bpy.app.binary_path or sys.executable
    scripts = folder / "scripts" / "addons"
    scripts.mkdir(parents=True, exist_ok=True)
    link = scripts / "echocast_blender"
    if not link.exists():
        link.symlink_to(Path(echocast_blender.__file__).parent)
    given = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(paths),
        "ECHOCAST_BLENDER": blender,
        "BLENDER_USER_SCRIPTS": str(scripts.parent),
        **environment,
    }
    command = [python, "-c", "from echocast._program import main; main()", "run", *arguments]
    return subprocess.run(command, cwd=folder, env=given, capture_output=True, text=True, timeout=300)


@pytest.mark.skipif(bool(bpy.app.binary_path), reason="a program of Blender finds the package only where it is installed")
def test_the_program_starts_blender_and_makes_the_set(folder: Path) -> None:
    done = program(folder, "drive.json", "-o", "out")
    assert done.returncode == 0, done.stderr
    assert "2 samples made" in done.stderr + done.stdout
    for sample in (0, 1):
        drawn = None
        for frame in range(3):
            (file,) = folder.glob(f"out/data/{sample:06}/top_{frame:04}.npz")
            cloud = ec.PointCloud.read(file)
            name = {name: number for number, name in cloud.categories.items()}
            places = cloud.xyz.astype(float) + cloud.origin
            wall = places[(cloud.category_id == name["Wall"]) & (np.abs(places[:, 1]) < 1.9)]
            time = cloud.time[(cloud.category_id == name["Wall"]) & (np.abs(places[:, 1]) < 1.9)]
            # Its near side, at the time of each beam.
            assert len(wall) > 20 and np.abs(wall[:, 0] - (18 + 5 * (time - time.min() + frame * 0.1 + 0.05))).max() < 0.3
            van = places[cloud.category_id == name["Van"]][:, 1].min()
            assert drawn is None or abs(van - drawn) < 0.02
            drawn = van
        assert 3.9 < drawn < 6.1


@pytest.mark.skipif(bool(bpy.app.binary_path), reason="a program of Blender finds the package only where it is installed")
def test_one_sample_is_described_on_stdout(folder: Path) -> None:
    done = program(folder, "drive.json", "--check", "--set", "samples=7")
    assert done.returncode == 0, done.stderr
    assert "top" in done.stdout and "Blender" not in done.stdout


def test_in_python_the_scene_is_given(folder: Path) -> None:
    scene = echocast_blender.animated_scene()
    assert scene.cameras == ["Top"] and set(scene.objects) == {"Wall", "Van"}
    scenario = ec.Scenario(KEYS, folder=folder, scene=scene)
    cloud = scenario[1].cloud(0, 2)
    assert {"Wall", "Van"} <= set(cloud.categories.values())
    assert abs(cloud.sensor_pose.position[0] - 0.4) < 1e-3
    with pytest.raises(ec.Error, match="only Blender can read"):
        ec.Scenario(KEYS, folder=folder)[0]
    with pytest.raises(ec.ArgumentError, match="scene.blend"):
        ec.Scenario({**KEYS, "scene": {"generate": "indoor"}}, scene=scene)
    # What a scenario hides and changes is hidden and changed.
    hidden = ec.Scenario({**KEYS, "scene": {"blend": "scene.blend", "hide": "Wall"}}, folder=folder, scene=scene)
    assert "Wall" not in {hidden[0].cloud().categories[number] for number in set(hidden[0].cloud().category_id)}


def test_wrong_files_and_programs_are_one_sentence(folder: Path) -> None:
    (folder / "missing.json").write_text(json.dumps({**KEYS, "scene": {"blend": "nothing.blend"}}))
    done = program(folder, "missing.json")
    assert done.returncode == 1 and done.stderr.count("\n") == 1 and "nothing.blend" in done.stderr
    done = program(folder, "drive.json", ECHOCAST_BLENDER="/nowhere/blender")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "ECHOCAST_BLENDER is /nowhere/blender, where there is no program; allowed:" in done.stderr
