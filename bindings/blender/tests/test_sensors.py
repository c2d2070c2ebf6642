"""Sensors as objects: presets, their parameters, where they are and where they look."""

import json
import math
from pathlib import Path
from typing import Any

import bpy
import echocast as ec
import makers
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from echocast_blender import sensors
from mathutils import Euler, Matrix

PRESETS = [name for name, _ in ec.presets()]

#: That a camera of Blender looks along x with z up.
ALONG_X = (math.pi / 2, 0, -math.pi / 2)


def same_instrument(one: ec.Sensor, other: ec.Sensor, without: "tuple[str, ...]" = ("expect",)) -> bool:
    first, second = one.to_dict(), other.to_dict()
    for key in without:
        first.pop(key, None)
        second.pop(key, None)
    return first == second


# --- parameters -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PRESETS)
def test_parameters_of_presets_give_back_the_instrument(name: str) -> None:
    thing = makers.sensor(name)
    own, preset = thing.echocast, ec.Sensor(name)
    assert not own.fault and own.section == own.sections()[0]
    found = {one.name: one.value() for one in own.parameters}
    wanted = {path: value for path, value in sensors.flattened(preset.to_dict()) if path.split(".")[0] not in sensors.HIDDEN}
    assert found == wanted
    assert not any(one.is_changed() for one in own.parameters)
    assert same_instrument(own.sensor(), preset)
    # Blender's own numbers are those that the originals stand for.
    for one in own.parameters:
        stored, original = getattr(one, one.field()), json.loads(one.original)
        convert = {"NUMBER": np.float32, "LIST": json.dumps}.get(one.kind, lambda same: same)
        assert stored == convert(original)


@pytest.mark.parametrize(
    ("preset", "path", "kind", "value", "expected"),
    [
        ("velodyne_vlp16", "range.max_m", "NUMBER", 55.5, 55.5),
        ("velodyne_vlp16", "noise.range_sigma_m", "NUMBER", 0.1, 0.1),
        ("velodyne_vlp16", "noise.range_sigma_m", "NUMBER", 0.0003, 0.0003),
        ("velodyne_vlp16", "returns.max", "WHOLE", 3, 3),
        ("velodyne_vlp16", "returns.mode", "TEXT", "dual", "dual"),
        ("velodyne_vlp16", "beam.sub_rays", "TEXT", "adaptive", "adaptive"),
        ("velodyne_vlp16", "beam.divergence_mrad", "LIST", "[2, 1]", [2.0, 1.0]),
        ("kinect_v2", "pattern.resolution", "LIST", "[64, 48]", [64, 48]),
        ("mbes_400", "acoustics.source_level_db", "NUMBER", 201.25, 201.25),
    ],
)
def test_changed_parameter_reaches_the_instrument(preset: str, path: str, kind: str, value: Any, expected: Any) -> None:
    thing = makers.sensor(preset)
    one = makers.parameter(thing, path)
    assert one.kind == kind
    setattr(one, one.field(), value)
    keys: Any = thing.echocast.sensor().to_dict()
    for key in path.split("."):
        keys = keys[key]
    assert keys == expected
    assert one.is_changed() == (expected != json.loads(one.original))
    # Its digits are shown.
    assert one.bl_rna.properties["number"].precision == 6


def test_changed_switch_reaches_the_instrument(tmp_path: Path) -> None:
    keys = ec.Sensor("sbes_200").to_dict()
    del keys["expect"]
    keys["acoustics"]["allow_ambiguity"] = True
    (tmp_path / "mine.yaml").write_text(json.dumps(keys))
    thing = makers.sensor(str(tmp_path / "mine.yaml"))
    one = makers.parameter(thing, "acoustics.allow_ambiguity")
    assert one.kind == "SWITCH" and thing.echocast.sensor().to_dict()["acoustics"]["allow_ambiguity"] is True
    one.switch = False
    assert not thing.echocast.sensor().to_dict()["acoustics"].get("allow_ambiguity", False)


@pytest.mark.parametrize("preset", ["velodyne_vlp16", "kinect_v2", "mbes_400", "livox_avia", "generic_lidar"])
def test_every_number_can_be_changed(preset: str) -> None:
    """To what the library accepts, or it is one sentence that names the key."""
    thing = makers.sensor(preset)
    accepted = 0
    for one in thing.echocast.parameters:
        if one.kind not in ("NUMBER", "WHOLE"):
            continue
        before = getattr(one, one.field())
        setattr(one, one.field(), before + 1)
        try:
            keys: Any = thing.echocast.sensor().to_dict()
        except ec.Error as error:
            assert one.name.split(".")[-1] in str(error) and "\n" not in str(error)
        else:
            for key in one.name.split("."):
                keys = keys[key]
            assert keys == pytest.approx(json.loads(one.original) + 1, rel=1e-6)
            accepted += 1
        setattr(one, one.field(), before)
    assert accepted > 5 and not any(one.is_changed() for one in thing.echocast.parameters)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("returns.mode", "sideways"),
        ("range.max_m", -1.0),
        ("range.max_m", math.inf),
        ("returns.max", 1000),
        ("beam.divergence_mrad", "[3, "),
        ("beam.divergence_mrad", '"wide"'),
        ("pattern.channels.elevation_deg", "[]"),
        ("pattern.type", "round"),
    ],
)
def test_wrong_values_are_one_sentence(path: str, value: Any) -> None:
    thing = makers.sensor("velodyne_vlp16", "Roof")
    makers.cube()
    one = makers.parameter(thing, path)
    setattr(one, one.field(), value)
    with pytest.raises(RuntimeError) as error:
        bpy.ops.echocast.scan()
    said = str(error.value).strip()
    assert said.startswith("Error: sensor Roof: ") and path.split(".")[-1] in said and "\n" not in said


@pytest.mark.parametrize("preset", ["no_such_sensor", "//missing.yaml", "/missing/sensor.yaml"])
def test_unknown_preset_is_told_and_scans_say_it(preset: str) -> None:
    thing = makers.sensor(preset, "Roof")
    makers.cube()
    assert thing.echocast.fault and not thing.echocast.parameters
    with pytest.raises(RuntimeError, match="Error: sensor Roof: "):
        bpy.ops.echocast.scan()
    thing.echocast.preset = "velodyne_vlp16"
    assert not thing.echocast.fault and thing.echocast.parameters


def test_sensor_file_with_a_mistake_is_told(tmp_path: Path) -> None:
    thing = makers.sensor(makers.write_sensor(tmp_path / "wrong.yaml", range={"max_m": "far"}))
    assert "max_m" in thing.echocast.fault and "wrong.yaml" in thing.echocast.fault


def test_sensor_file_that_was_edited_is_read_again(tmp_path: Path) -> None:
    path = makers.write_sensor(tmp_path / "mine.yaml")
    thing = makers.sensor(path)
    assert "range" not in thing.echocast.sensor().to_dict() or "max_m" not in thing.echocast.sensor().to_dict()["range"]
    makers.write_sensor(tmp_path / "mine.yaml", range={"max_m": 12.0})
    thing.echocast.preset = path
    assert thing.echocast.sensor()["range.max_m"] == 12.0
    assert makers.parameter(thing, "range.max_m").value() == 12.0


def test_table_of_a_sensor_file_is_found_after_a_change(tmp_path: Path) -> None:
    (tmp_path / "rays.csv").write_text("azimuth_deg,elevation_deg\n0,0\n1,0\n")
    pattern = {"type": "table", "file": "rays.csv", "rate_hz": 10}
    path = makers.write_sensor(tmp_path / "table.yaml", kind="lidar", pattern=pattern)
    thing = makers.sensor(path)
    assert thing.echocast.sensor().beams == 2
    makers.parameter(thing, "pattern.rate_hz").number = 5.0
    assert thing.echocast.sensor().beams == 2 and thing.echocast.sensor().period == pytest.approx(0.2)


def test_preset_beside_the_file(tmp_path: Path) -> None:
    makers.write_sensor(tmp_path / "mine.yaml", title="Mine")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert makers.sensor("//mine.yaml").echocast.sensor().title == "Mine"


def test_reset() -> None:
    thing = makers.sensor("velodyne_vlp16")
    makers.parameter(thing, "range.max_m").number = 12.0
    makers.parameter(thing, "returns.mode").text = "dual"
    assert thing.echocast.sensor()["range.max_m"] == 12.0
    bpy.context.view_layer.objects.active = thing
    assert bpy.ops.echocast.reset_parameters() == {"FINISHED"}
    assert same_instrument(thing.echocast.sensor(), ec.Sensor("velodyne_vlp16"), without=())


def test_another_preset_replaces_all_parameters() -> None:
    thing = makers.sensor("velodyne_vlp16")
    makers.parameter(thing, "range.max_m").number = 12.0
    thing.echocast.preset = "mbes_400"
    assert same_instrument(thing.echocast.sensor(), ec.Sensor("mbes_400"))
    thing.echocast.preset = ""
    assert not thing.echocast.parameters
    with pytest.raises(ec.ArgumentError, match="has no preset"):
        thing.echocast.sensor()


def test_copies_are_instruments_of_their_own() -> None:
    first = makers.sensor("velodyne_vlp16")
    second = first.copy()
    bpy.context.scene.collection.objects.link(second)
    makers.parameter(second, "range.max_m").number = 12.0
    assert (first.echocast.sensor()["range.max_m"], second.echocast.sensor()["range.max_m"]) == (100.0, 12.0)
    # What takes the place of a removed one in memory is not it.
    for _ in range(5):
        bpy.data.objects.remove(second)
        second = first.copy()
        bpy.context.scene.collection.objects.link(second)
        assert second.echocast.sensor()["range.max_m"] == 100.0
        makers.parameter(second, "range.max_m").number = 12.0
        assert second.echocast.sensor()["range.max_m"] == 12.0


def test_animated_parameter() -> None:
    thing = makers.sensor("velodyne_vlp16")
    one = makers.parameter(thing, "range.max_m")
    for frame, value in ((1, 10.0), (11, 20.0)):
        one.number = value
        one.keyframe_insert("number", frame=frame)
    bpy.context.scene.frame_set(1)
    assert thing.echocast.sensor()["range.max_m"] == 10.0
    bpy.context.scene.frame_set(11)
    assert thing.echocast.sensor()["range.max_m"] == 20.0


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("velodyne", {"velodyne_vlp16", "velodyne_vls128", "velodyne_ultrapuck"}),
        ("Ouster OS1", {"ouster_os1_64", "ouster_os1_128"}),
        ("tof", {"kinect_v2", "realsense_l515"}),
        ("sonar side", {"sss_900"}),
        ("puck 32", {"velodyne_vlp32c"}),
        ("", set(PRESETS)),
        # A full name is what is set already: all are shown.
        ("kinect_v2", set(PRESETS)),
    ],
)
def test_search(text: str, found: "set[str]") -> None:
    names = {name for name, _ in sensors.preset_names(None, None, text)}
    assert found <= names
    if text in ("tof", "sonar side"):
        assert all(ec.Sensor(name).kind == text.split()[0] for name in names)
    if text.startswith(("velodyne", "Ouster")):
        assert len(names) < 12


def test_saved_and_loaded(tmp_path: Path) -> None:
    """Every setting of sensors and of the scene."""
    for name in ("velodyne_vlp16", "mbes_400", "kinect_v2"):
        thing = makers.sensor(name, f"My {name}", kind="CAMERA" if name == "kinect_v2" else "EMPTY")
        for one in thing.echocast.parameters:
            if one.name in ("range.max_m", "noise.range_sigma_m"):
                one.number = 42.25
        thing.echocast.enabled = name != "mbes_400"
        thing.echocast.view_length, thing.echocast.show_view = 7.0, False
    wanted = bpy.context.scene.echocast
    wanted.seed, wanted.profile, wanted.fog, wanted.visibility = 9, "paper", True, 77.0
    wanted.columns, wanted.color = "all", "range"
    wanted.frames, wanted.step, wanted.motion, wanted.noise, wanted.radius = "RANGE", 3, False, False, 0.5
    wanted.outputs.add().format = "ply"
    wanted.outputs[0].path = "//here"
    layer = wanted.layers.add()
    layer.depth, layer.speed, layer.density = 5.0, 1480.0, 1030.0
    wanted.keys = bpy.data.texts.new("More")
    before = {thing.name: thing.echocast.sensor().to_dict() for thing in sensors.all_of(bpy.context.scene, only_enabled=False)}
    assert before["My velodyne_vlp16"]["range"]["max_m"] == 42.25
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert not sensors.all_of(bpy.context.scene)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    scene = bpy.context.scene
    assert {thing.name: thing.echocast.sensor().to_dict() for thing in sensors.all_of(scene, only_enabled=False)} == before
    assert [thing.name for thing in sensors.all_of(scene)] == ["My kinect_v2", "My velodyne_vlp16"]
    for thing in sensors.all_of(scene):
        assert (thing.echocast.view_length, thing.echocast.show_view) == (7.0, False)
    wanted = scene.echocast
    assert (wanted.seed, wanted.profile, wanted.fog, wanted.visibility, wanted.columns) == (9, "paper", True, 77.0, "all")
    assert (wanted.frames, wanted.step, wanted.motion, wanted.noise, wanted.radius) == ("RANGE", 3, False, False, 0.5)
    assert [(one.format, one.path) for one in wanted.outputs] == [("ply", "//here")]
    assert [(one.depth, one.speed, one.density) for one in wanted.layers] == [(5.0, 1480.0, 1030.0)]
    assert wanted.keys.name == "More" and wanted.color == "range"


# --- where they are ---------------------------------------------------------------------------------------------------


def room() -> None:
    """Five walls that are not symmetric in any way."""
    walls = (((4, 0, 0), 0), ((0, 5, 1), 90), ((-6, 0, 0), 180), ((0, -3, 0), 270), ((3, 2, 1), 30))
    for index, (place, turn) in enumerate(walls):
        wall = makers.wall(f"Wall{index}", 2 + index, place)
        wall.rotation_euler.z = math.radians(turn)


@pytest.fixture
def camera_file(tmp_path: Path) -> str:
    return makers.write_sensor(tmp_path / "camera.yaml")


def test_camera_and_empty_look_the_same_way(camera_file: str) -> None:
    room()
    first = makers.sensor(camera_file, "Empty", (0.2, 0.1, 0.3))
    first.rotation_euler = (0.1, -0.2, 0.4)
    seen = makers.cloud("range,beam,x,y,z,category_id")
    bpy.data.objects.remove(first)
    second = makers.sensor(camera_file, "Camera", (0.2, 0.1, 0.3), "CAMERA")
    second.rotation_euler = (Euler((0.1, -0.2, 0.4)).to_matrix() @ Euler(ALONG_X).to_matrix()).to_euler()
    other = makers.cloud("range,beam,x,y,z,category_id")
    assert len(seen) > 300 and np.array_equal(seen.beam, other.beam)
    assert np.allclose(seen.range, other.range, atol=1e-4) and np.array_equal(seen.category_id, other.category_id)


def test_camera_sees_what_a_camera_of_blender_sees(camera_file: str) -> None:
    """Its pixels are where Blender projects the points to."""
    room()
    thing = makers.sensor(camera_file, "Camera", (0.2, 0.1, 0.3), "CAMERA")
    thing.rotation_euler = (1.4, 0.2, -1.3)
    thing.data.angle = math.radians(60)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 32, 24
    bpy.context.view_layer.update()
    seen = makers.cloud("range,beam,x,y,z")
    assert len(seen) > 300
    vertical = math.tan(math.radians(46.8) / 2) / (math.tan(math.radians(30)) * 24 / 32)
    for place, beam in list(zip(seen.xyz + np.array(seen.origin), seen.beam))[::17]:
        view = world_to_camera_view(scene, thing, Matrix.Translation(place).translation)
        column, row = beam % 32, beam // 32
        assert view.x * 32 == pytest.approx(column + 0.5, abs=0.01)
        assert 12 - (view.y - 0.5) * 24 / vertical == pytest.approx(row + 0.5, abs=0.05)


def test_empty_looks_along_x(camera_file: str) -> None:
    makers.wall("Ahead", 1, (4, 0, 0))
    makers.sensor(camera_file)
    assert makers.cloud("range,beam").range.min() == pytest.approx(4, abs=0.01)


@pytest.mark.parametrize("scale", [(2, 2, 2), (0.5, 3, 7)])
@pytest.mark.parametrize("kind", ["EMPTY", "CAMERA"])
def test_scaled_sensor_is_the_same(camera_file: str, scale: Any, kind: str) -> None:
    room()
    thing = makers.sensor(camera_file, "Sensor", (0.2, 0.1, 0.3), kind)
    thing.rotation_euler = (0.1, -0.2, 0.4) if kind == "EMPTY" else ALONG_X
    before = makers.cloud("range,beam")
    thing.scale = scale
    after = makers.cloud("range,beam")
    assert np.array_equal(before.beam, after.beam) and np.allclose(before.range, after.range, atol=1e-4)


def test_sensor_on_a_parent_that_is_scaled_and_turned(camera_file: str) -> None:
    room()
    free = makers.sensor(camera_file, "Free", (0.4, 0.6, 0.5))
    free.rotation_euler = (0, 0, math.radians(50))
    car = makers.empty("Car", (0, 0, 0.1))
    car.rotation_euler, car.scale = (0, 0, math.radians(30)), (2, 2, 2)
    bound = makers.sensor(camera_file, "Bound")
    bound.parent = car
    turn = Matrix.Rotation(math.radians(-30), 3, "Z")
    bound.location = turn @ Matrix.Translation((0.4, 0.6, 0.4)).translation / 2
    bound.rotation_euler = (0, 0, math.radians(20))
    one, other = (result.cloud for result in makers.scans("range,beam"))
    assert len(one) > 300 and np.array_equal(one.beam, other.beam) and np.allclose(one.range, other.range, atol=1e-4)


def test_unit_scale(camera_file: str) -> None:
    """A scene in centimetres."""
    makers.wall("Wall", 200, (400, 0, 0))
    makers.sensor(camera_file, "Sensor", (100, 0, 0))
    bpy.context.scene.unit_settings.scale_length = 0.01
    seen = makers.cloud("range,beam,x,y,z")
    assert seen.range.min() == pytest.approx(3, abs=0.01)
    assert (seen.xyz + np.array(seen.origin))[:, 0] == pytest.approx(4, abs=1e-4)


def test_rig_of_two_sensors_and_one_that_is_off(camera_file: str) -> None:
    room()
    makers.sensor(camera_file, "Front")
    makers.sensor(camera_file, "Back").rotation_euler.z = math.pi
    makers.sensor(camera_file, "Off").echocast.enabled = False
    results = makers.scans("range,beam")
    assert [result.task.name for result in results] == ["Back", "Front"]
    assert results[0].cloud.range.min() == pytest.approx(6, abs=0.01)


def test_rig_of_light_and_sound_in_fog_and_water() -> None:
    """Fog is for the LiDAR, water for the sonar."""
    makers.plane("Bed", 40, (0, 0, -8))
    makers.wall("Wall", 10, (6, 0, 0))
    makers.sensor("velodyne_vlp16", "Lidar", (0, 0, 1))
    makers.sensor("mbes_400", "Sonar", (0, 0, -1))
    wanted = bpy.context.scene.echocast
    wanted.fog, wanted.visibility, wanted.water = True, 60.0, True
    lidar, sonar = makers.scans()
    assert len(lidar.cloud) and len(sonar.cloud) and sonar.ping is not None


@pytest.mark.parametrize("name", PRESETS)
def test_presets_without_errors(name: str) -> None:
    keys = sensors.without_errors(ec.Sensor(name)).to_dict()
    assert not any(value for path, value in sensors.flattened(keys) if path in sensors.ERROR_NUMBERS)
    assert keys.get("tof", {}).get("depth_noise", {"model": "none"}) == {"model": "none"}


@pytest.mark.parametrize("preset", ["velodyne_vlp16", "kinect_v2"])
def test_without_noise_there_is_none(preset: str) -> None:
    makers.wall("Wall", 6, (3, 0, 0))
    makers.sensor(preset)
    wanted = bpy.context.scene.echocast
    wanted.columns = "range,true_range"
    noisy = makers.cloud()
    wanted.noise = False
    clean = makers.cloud()
    assert np.abs(noisy.range - noisy.true_range).max() > 0.004
    # The steps that it reports, and the slope of the wall within a pixel, remain.
    assert np.abs(clean.range - clean.true_range).max() < 0.004
