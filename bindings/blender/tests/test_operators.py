"""What the buttons do, and scans without a window."""

import json
import math
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import echocast as ec
import echocast_blender
import makers
import numpy as np
import pytest
from echocast_blender import clouds, operators, paper, scan, scene, srgb

FORMATS = [name for name, _ in ec.formats()]


@pytest.fixture
def camera(tmp_path: Path) -> Any:
    """A small camera before two walls."""
    makers.wall("Wall", 2, (3, 0, 0), makers.material("Paint", Base_Color=(0.8, 0.1, 0.1, 1)))
    makers.wall("Backdrop", 12, (6, 0, 0))
    return makers.sensor(makers.write_sensor(tmp_path / "camera.yaml"), "Camera")


def result(name: str = "Camera 1") -> Any:
    return bpy.data.objects[name]


def column(thing: Any, name: str) -> Any:
    attribute = thing.data.attributes[name]
    size = {"FLOAT": 1, "INT": 1, "FLOAT_COLOR": 4}[attribute.data_type]
    values = np.empty(size * len(attribute.data), dtype=np.int32 if attribute.data_type == "INT" else np.float32)
    attribute.data.foreach_get("color" if size == 4 else "value", values)
    return values.reshape(-1, size) if size > 1 else values


def places(thing: Any) -> Any:
    values = np.empty(3 * len(thing.data.vertices), dtype=np.float32)
    thing.data.vertices.foreach_get("co", values)
    return values.reshape(-1, 3)


# --- scan -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("columns", ["default", "all", "range", "range,intensity,normal_x"])
def test_cloud_has_all_columns(camera: Any, columns: str) -> None:
    bpy.context.scene.echocast.columns = columns
    seen = makers.cloud()
    assert bpy.ops.echocast.scan() == {"FINISHED"}
    thing = result()
    assert len(thing.data.vertices) == len(seen) > 400
    assert np.allclose(places(thing), seen.xyz) and tuple(thing.location) == tuple(seen.origin)
    for name in seen.fields:
        if name not in ("x", "y", "z"):
            values = seen[name].astype(np.float64)
            assert np.array_equal(column(thing, name), values - values.min() if name == "time" else values, equal_nan=True), name
    for table in ("categories", "parts", "instances", "materials"):
        assert thing[table].to_dict() == {str(number): name for number, name in getattr(seen, table).items()}
    assert {"Wall", "Backdrop"} <= set(thing["categories"].to_dict().values())


def test_cloud_is_where_the_points_are_in_other_units(camera: Any) -> None:
    bpy.context.scene.unit_settings.scale_length = 0.5
    bpy.ops.echocast.scan()
    bpy.context.view_layer.update()
    x = (places(result()) + np.array(result().location))[:, 0]
    assert set(np.round(x, 3)) == {3.0, 6.0}


def test_second_scan_fills_the_same_objects(camera: Any) -> None:
    bpy.ops.echocast.scan()
    kinds = ("objects", "images", "collections", "materials", "node_groups")
    names = {kind: sorted(one.name for one in getattr(bpy.data, kind)) for kind in kinds}
    first = len(result().data.vertices)
    meshes = len(bpy.data.meshes)
    bpy.data.objects["Backdrop"].hide_render = True
    bpy.ops.echocast.scan()
    assert {kind: sorted(one.name for one in getattr(bpy.data, kind)) for kind in kinds} == names
    assert len(bpy.data.meshes) == meshes
    assert len(result().data.vertices) < first


@pytest.mark.parametrize("name", ["Camera.001", "x" * 63])
def test_second_scan_of_sensors_with_odd_names(camera: Any, name: str) -> None:
    camera.name = name
    for _ in range(2):
        bpy.ops.echocast.scan()
        assert sum(scene.RESULT in one for one in bpy.data.objects) == 1 and len(bpy.data.images) == 2


def test_own_clouds_are_not_scanned(camera: Any) -> None:
    bpy.ops.echocast.scan()
    first = places(result())
    result().hide_render = False
    bpy.ops.echocast.scan()
    assert np.array_equal(places(result()), first)


def test_range_of_frames_with_steps(camera: Any) -> None:
    timeline = bpy.context.scene
    timeline.frame_start, timeline.frame_end = 3, 8
    timeline.echocast.frames, timeline.echocast.step = "RANGE", 2
    wall = bpy.data.objects["Wall"]
    for frame, x in ((3, 3.0), (7, 4.0)):
        wall.location.x = x
        wall.keyframe_insert("location", frame=frame)
    for curve in curves_of(wall):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    timeline.frame_set(5, subframe=0.25)
    timeline.echocast.motion = False
    assert bpy.ops.echocast.scan() == {"FINISHED"}
    assert [one.name for one in bpy.data.objects if scene.RESULT in one] == ["Camera 3", "Camera 5", "Camera 7"]
    nearest = [column(result(f"Camera {frame}"), "range").min() for frame in (3, 5, 7)]
    assert nearest == pytest.approx([3.0, 3.5, 4.0], abs=0.02)
    assert (timeline.frame_current, timeline.frame_subframe) == (5, pytest.approx(0.25))


def curves_of(thing: Any) -> Any:
    action = thing.animation_data.action
    if hasattr(action, "fcurves"):
        return action.fcurves
    return action.layers[0].strips[0].channelbag(action.slots[0]).fcurves


def test_options_of_results(camera: Any) -> None:
    wanted = bpy.context.scene.echocast
    wanted.clouds = wanted.images = False
    before = len(bpy.data.objects)
    bpy.ops.echocast.scan()
    assert len(bpy.data.objects) == before and not bpy.data.images
    wanted.images = True
    bpy.ops.echocast.scan()
    assert len(bpy.data.objects) == before and "Camera 1 depth" in bpy.data.images


def test_undo_and_redo(camera: Any) -> None:
    if not bpy.ops.ed.undo_push.poll():
        pytest.skip("there is no undo here")
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.echocast.scan("EXEC_DEFAULT", True)
    points = len(result().data.vertices)
    bpy.ops.ed.undo()
    assert not any(scene.RESULT in one for one in bpy.data.objects) and "Camera" in bpy.data.objects
    bpy.ops.ed.redo()
    assert len(result().data.vertices) == points
    bpy.ops.ed.undo()
    # What was exported before is of memory that undo has given back.
    bpy.data.objects["Wall"].location.x = 3.5
    bpy.ops.echocast.scan()
    assert column(result(), "range").min() == pytest.approx(3.5, abs=0.02)


def test_scan_of_nothing_in_sight_is_empty(camera: Any) -> None:
    bpy.data.objects["Camera"].rotation_euler.z = math.pi
    assert bpy.ops.echocast.scan() == {"FINISHED"}
    assert len(result().data.vertices) == 0
    assert "Camera: no beam has a return" in json.loads(bpy.context.scene.echocast.notes)[0]


# --- colours and images -----------------------------------------------------------------------------------------------


def test_colors_by_label(camera: Any) -> None:
    bpy.context.scene.echocast.color = "category_id"
    bpy.ops.echocast.scan()
    colors, category = column(result(), clouds.COLOR), column(result(), "category_id")
    for number in set(category.tolist()):
        shown = np.unique(colors[category == number], axis=0)
        assert len(shown) == 1 and tuple(shown[0]) == pytest.approx(clouds.label_color(number), abs=1e-6)
    assert len({clouds.label_color(number) for number in range(200)}) == 200


@pytest.mark.parametrize("name", ["range", "intensity"])
def test_colors_by_number(camera: Any, name: str) -> None:
    bpy.context.scene.echocast.color = name
    bpy.ops.echocast.scan()
    colors, values = column(result(), clouds.COLOR), column(result(), name)
    low, high = values.argmin(), values.argmax()
    assert tuple(colors[low][:3]) == pytest.approx(clouds.SCALE[0, 1:], abs=1e-5)
    assert tuple(colors[high][:3]) == pytest.approx(clouds.SCALE[-1, 1:], abs=1e-5)


@pytest.mark.parametrize(("name", "expected"), [("color", (0.8, 0.1, 0.1)), ("no_such_column", (0.8, 0.8, 0.8))])
def test_colors_of_the_surface_and_of_nothing(camera: Any, name: str, expected: Any) -> None:
    wanted = bpy.context.scene.echocast
    wanted.color, wanted.columns = name, "default,red,green,blue"
    bpy.data.objects.remove(bpy.data.objects["Backdrop"])
    bpy.ops.echocast.scan()
    assert np.allclose(column(result(), clouds.COLOR)[:, :3], expected, atol=0.01)


def test_colors_change_at_once(camera: Any) -> None:
    """Of the scans that are there, also without any, and not of those that are not the scene's to change."""
    wanted = bpy.context.scene.echocast
    wanted.color = "range"
    bpy.ops.echocast.scan()
    before = column(result(), clouds.COLOR)
    for name in ("intensity", "category_id", "z", "no_such_column", "beam", "range"):
        wanted.color = name
        assert scene.made_by(result())["color"] == name
        assert np.array_equal(column(result(), clouds.COLOR), before) == (name == "range")
        if name == "category_id":
            numbers = column(result(), name)
            assert all(tuple(color) == pytest.approx(clouds.label_color(number), abs=1e-6)
                for number, color in zip(numbers[::50], column(result(), clouds.COLOR)[::50]))
    colors = bpy.data.objects["Wall"].data.attributes
    assert clouds.COLOR not in colors
    # In edit mode, and where somebody has replaced them.
    bpy.context.view_layer.objects.active = result()
    bpy.ops.object.mode_set(mode="EDIT")
    wanted.color = "intensity"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert scene.made_by(result())["color"] == "range"
    result().data.attributes.remove(result().data.attributes[clouds.COLOR])
    wanted.color = "category_id"
    assert len(column(result(), clouds.COLOR)) == len(before)


def test_colors_of_labels_are_as_they_are_shown() -> None:
    """In sRGB all are as bright, and their saturation is one of two."""
    for number in range(1, 50):
        light = np.array(clouds.label_color(number)[:3])
        shown = srgb.encoded(light)
        assert shown.max() == pytest.approx(0.8) and 1 - shown.min() / shown.max() == pytest.approx(0.75 if number % 2 else 0.55)
        assert srgb.light(shown) == pytest.approx(light)


def test_points_are_shown_with_their_material(camera: Any) -> None:
    bpy.context.scene.echocast.radius = 0.125
    bpy.ops.echocast.scan()
    (modifier,) = result().modifiers
    paint = next(node for node in modifier.node_group.nodes if node.bl_idname == "GeometryNodeSetMaterial")
    assert paint.inputs["Material"].default_value == bpy.data.materials[clouds.MATERIAL]
    made = result().evaluated_get(bpy.context.evaluated_depsgraph_get())
    found = [one for one in bpy.context.evaluated_depsgraph_get().object_instances if one.object.name == made.name]
    assert found
    bpy.context.scene.echocast.radius = 0.25
    bpy.ops.echocast.scan()
    assert len(result().modifiers) == 1


def pixels(name: str) -> Any:
    image = bpy.data.images[name]
    values = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)[::-1]


def test_images_of_a_camera(camera: Any) -> None:
    bpy.ops.echocast.scan()
    depth = pixels("Camera 1 depth")
    assert depth.shape == (24, 32, 4)
    low, high = bpy.data.images["Camera 1 depth"]["echocast_range"]
    assert (low, high) == pytest.approx((3.0, 6.0), abs=0.01)
    assert depth[12, 16, 0] == pytest.approx(0, abs=1e-5) and depth[1, 1, 0] == pytest.approx(1, abs=1e-5)
    category = pixels("Camera 1 category")
    assert category[12, 16, 0] != category[1, 1, 0] and len(np.unique(category[:, :, 0])) == 2


def test_images_are_filled_anew(camera: Any) -> None:
    bpy.ops.echocast.scan()
    count = len(bpy.data.images)
    bpy.data.objects["Wall"].location.x = 4
    bpy.ops.echocast.scan()
    assert len(bpy.data.images) == count
    assert bpy.data.images["Camera 1 depth"]["echocast_range"][0] == pytest.approx(4, abs=0.01)


@pytest.mark.parametrize("preset", ["sss_900", "mbes_400", "fls_900", "sbes_200", "water_linked_a50"])
def test_images_of_sonars(preset: str) -> None:
    makers.plane("Bed", 60, (0, 0, -6))
    makers.cube("Rock", 1, (5, 3, -5.5))
    makers.sensor(preset, "Sonar", (0, 0, -1))
    bpy.context.scene.echocast.water = True
    bpy.ops.echocast.scan()
    levels = pixels("Sonar 1 levels")
    assert levels.shape[0] >= 1 and levels.shape[1] > 50 and levels[:, :, 0].max() == pytest.approx(1)
    low, high = bpy.data.images["Sonar 1 levels"]["echocast_range"]
    assert high > low
    assert len(result("Sonar 1").data.vertices) > 0


def test_sonars_ping_for_images_only(monkeypatch: pytest.MonkeyPatch) -> None:
    makers.plane("Bed", 60, (0, 0, -6))
    makers.sensor("sbes_200", "Sonar", (0, 0, -1))
    bpy.context.scene.echocast.water, bpy.context.scene.echocast.images = True, False
    assert [one.ping for one in makers.scans()] == [None]
    bpy.ops.echocast.scan()
    assert len(result("Sonar 1").data.vertices) > 0 and not bpy.data.images


def test_images_are_saved_with_the_file(camera: Any, tmp_path: Path) -> None:
    bpy.ops.echocast.scan()
    before = pixels("Camera 1 depth")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert np.allclose(pixels("Camera 1 depth"), before, atol=1e-3)
    assert len(result().data.vertices) > 400


# --- files ------------------------------------------------------------------------------------------------------------


def test_files_of_every_format(camera: Any, tmp_path: Path) -> None:
    """All in one folder."""
    for name in FORMATS:
        output = bpy.context.scene.echocast.outputs.add()
        output.format, output.path = name, str(tmp_path / "made" / "{sensor}")
    off = bpy.context.scene.echocast.outputs.add()
    off.enabled, off.path = False, str(tmp_path / "not_made")
    seen = makers.cloud()
    bpy.ops.echocast.scan()
    made = sorted((tmp_path / "made" / "Camera").iterdir())
    written = [path for path in made if not path.name.endswith(".labels.json")]
    assert len(written) == len(FORMATS) and not (tmp_path / "not_made").exists()
    readable = 0
    for path in written:
        assert path.name.startswith("Camera_0001")
        try:
            found, _ = ec.read_cloud(path)
        except ec.Error:
            assert path.suffix == ".mcap"
            continue
        readable += 1
        assert len(found) == len(seen)
        assert np.allclose(found.xyz + np.array(found.origin), seen.xyz + np.array(seen.origin), atol=2e-3), path.name
    assert readable >= 12


def test_files_of_two_sensors_beside_the_blend_file(camera: Any, tmp_path: Path) -> None:
    makers.sensor(bpy.data.objects["Camera"].echocast.preset, "Second one")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    output = bpy.context.scene.echocast.outputs.add()
    output.format, output.path = "csv", "//out"
    bpy.ops.echocast.scan()
    assert {path.name for path in (tmp_path / "out").glob("*.csv")} == {"Camera_0001.csv", "Second_one_0001.csv"}


def test_run_without_a_window(camera: Any, tmp_path: Path, capsys: Any) -> None:
    timeline = bpy.context.scene
    timeline.frame_set(4, subframe=0.5)
    before = makers.fingerprint()
    paths = echocast_blender.run(str(tmp_path / "scans"), frames=[1, 2], format="ply")
    assert [path.name for path in paths] == ["Camera_0001.ply", "Camera_0002.ply"] and all(path.is_file() for path in paths)
    assert "Camera, frame 2: " in capsys.readouterr().out
    assert not makers.differences(before) and timeline.frame_current == 4
    with pytest.raises(ec.ArgumentError, match="format is 'xyz'"):
        echocast_blender.run(str(tmp_path), format="xyz")
    with pytest.raises(ec.ArgumentError, match="is not saved"):
        echocast_blender.run()


def test_run_with_a_list_of_files(camera: Any, tmp_path: Path) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert [path.parent for path in echocast_blender.run(quiet=True)] == [tmp_path / "scans"]
    output = bpy.context.scene.echocast.outputs.add()
    output.format, output.path = "csv", "//listed"
    assert echocast_blender.run(quiet=True) == []
    assert (tmp_path / "listed" / "Camera_0001.csv").is_file()


# --- in a window ------------------------------------------------------------------------------------------------------


class Manager:
    """Stands for the parts of a window that a running scan uses."""

    def __init__(self) -> None:
        self.parts: "list[int]" = []
        self.timers = 0

    def event_timer_add(self, step: float, window: Any) -> str:
        self.timers += 1
        return "timer"

    def event_timer_remove(self, timer: str) -> None:
        self.timers -= 1

    def progress_begin(self, low: int, high: int) -> None:
        pass

    def progress_update(self, value: int) -> None:
        self.parts.append(value)

    def progress_end(self) -> None:
        pass

    def modal_handler_add(self, operator: Any) -> None:
        pass

    def status_text_set(self, text: "str | None") -> None:
        self.status = text


class Running:
    """An operator in a window, driven by hand."""

    undone = property(lambda self: operators.EchocastScan.undone)

    begin, modal, step, obstacle, cancel, end = (
        getattr(operators.EchocastScan, name) for name in ("begin", "modal", "step", "obstacle", "cancel", "end")
    )

    def __init__(self) -> None:
        self.reports: "list[tuple[set[str], str]]" = []
        self.manager = Manager()
        context = bpy.context
        self.context = SimpleNamespace(
            scene=context.scene,
            view_layer=context.view_layer,
            evaluated_depsgraph_get=context.evaluated_depsgraph_get,
            window_manager=self.manager,
            workspace=self.manager,
            window=None,
            mode="OBJECT",
        )
        self.begin(self.context)

    def report(self, kind: "set[str]", text: str) -> None:
        self.reports.append((kind, text))

    def event(self, kind: str = "TIMER") -> "set[str]":
        return self.modal(self.context, SimpleNamespace(type=kind, value="PRESS"))

    def to_the_end(self) -> "set[str]":
        deadline = time.monotonic() + 20
        while (outcome := self.event()) == {"PASS_THROUGH"} and time.monotonic() < deadline:
            time.sleep(0.005)
        return outcome


@pytest.fixture(autouse=True)
def no_scan_is_left() -> Iterator[None]:
    yield
    assert not operators.EchocastScan.running


def test_scan_in_a_window(camera: Any) -> None:
    timeline = bpy.context.scene
    timeline.frame_start, timeline.frame_end = 1, 3
    timeline.echocast.frames = "RANGE"
    timeline.frame_set(7)
    running = Running()
    # The viewport can be turned, and all else be done.
    for kind in ("MOUSEMOVE", "MIDDLEMOUSE", "LEFTMOUSE", "TRACKPADPAN", "G", "TIMER"):
        assert running.event(kind) == {"PASS_THROUGH"}
    assert running.to_the_end() == {"FINISHED"} and running.reports[-1][0] == {"INFO"}
    assert [one.name for one in bpy.data.objects if scene.RESULT in one] == ["Camera 1", "Camera 2", "Camera 3"]
    assert running.manager.timers == 0 and running.manager.status is None and timeline.frame_current == 7
    assert running.manager.parts == sorted(running.manager.parts)


def test_escape_leaves_nothing_half_made(camera: Any) -> None:
    bpy.data.objects["Camera"].echocast.preset = "velodyne_vls128"
    before = makers.fingerprint()
    running = Running()
    running.event()
    assert running.event("ESC") == {"CANCELLED"}
    assert running.reports == [({"ERROR"}, "stopped: what was scanned before remains")]
    assert running.manager.timers == 0 and not makers.differences(before)


def test_fault_in_a_window(camera: Any) -> None:
    bpy.data.objects["Camera"].echocast.preset = "no_such"
    running = Running()
    assert running.event() == {"CANCELLED"}
    assert running.reports[0][0] == {"ERROR"} and running.manager.timers == 0


def test_nothing_else_is_scanned_while_a_scan_runs(camera: Any, tmp_path: Path) -> None:
    bpy.ops.echocast.scan()
    select(result(), 7)
    running = Running()
    running.event()
    for operator in (bpy.ops.echocast.scan, bpy.ops.echocast.explain):
        assert not operator.poll()
        with pytest.raises(RuntimeError, match="a scan is running; allowed: one at a time"):
            operator()
    for function in (lambda: echocast_blender.run(str(tmp_path)), echocast_blender.animated_scene):
        with pytest.raises(ec.ArgumentError, match="a scan is running; allowed: one at a time"):
            function()
    assert running.to_the_end() == {"FINISHED"}
    assert bpy.ops.echocast.scan() == {"FINISHED"}


@pytest.mark.parametrize("what", ["sensor", "seen", "result", "collection", "all"])
def test_things_that_are_deleted_during_a_scan(camera: Any, what: str) -> None:
    """What is scanned was read before: its points come all the same."""
    bpy.ops.echocast.scan()
    points = len(result().data.vertices)
    running = Running()
    running.event()
    things = {
        "sensor": [camera],
        "seen": [bpy.data.objects["Wall"]],
        "result": [result()],
        "collection": [],
        "all": list(bpy.data.objects),
    }
    for thing in things[what]:
        bpy.data.objects.remove(thing)
    if what in ("collection", "all"):
        bpy.data.collections.remove(bpy.data.collections[clouds.COLLECTION])
    if what == "all":
        for kind in (bpy.data.meshes, bpy.data.materials, bpy.data.node_groups, bpy.data.images):
            for one in list(kind):
                kind.remove(one)
    assert running.to_the_end() == {"FINISHED"}
    assert len(result().data.vertices) == points


def test_changes_during_a_scan_count_from_the_next_frame_on(camera: Any) -> None:
    timeline = bpy.context.scene
    timeline.frame_start, timeline.frame_end, timeline.echocast.frames = 1, 2, "RANGE"
    running = Running()
    running.event()
    bpy.data.objects["Wall"].location.x = 4.0
    timeline.frame_set(9)
    assert running.to_the_end() == {"FINISHED"}
    nearest = [column(result(f"Camera {frame}"), "range").min() for frame in (1, 2)]
    assert nearest == pytest.approx([3.0, 4.0], abs=0.02)
    running = Running()
    running.event()
    bpy.data.objects.remove(camera)
    assert running.to_the_end() == {"FINISHED"}
    ((kind, text),) = running.reports
    assert kind == {"ERROR"} and text.startswith("the scene has no sensor")


@pytest.mark.parametrize("begun", [False, True])
def test_undo_during_a_scan_stops_it_where_it_takes_results_away(camera: Any, begun: bool) -> None:
    """Blender then calls `note_undo`."""
    timeline = bpy.context.scene
    timeline.frame_start, timeline.frame_end, timeline.echocast.frames = 1, 2, "RANGE"
    running = Running()
    while running.done < begun:
        running.event()
    operators.note_undo()
    assert running.to_the_end() == {"FINISHED"}
    assert ("Camera 2" in bpy.data.objects) == (not begun)
    (report,) = running.reports
    assert ("stopped by undo" in report[1]) == begun


def test_a_frame_that_the_user_goes_to_stays(camera: Any) -> None:
    timeline = bpy.context.scene
    running = Running()
    running.event()
    timeline.frame_set(9)
    assert running.to_the_end() == {"FINISHED"}
    assert timeline.frame_current == 9 and "Camera 1" in bpy.data.objects


@pytest.mark.parametrize("why", ["mode", "scene"])
def test_a_scan_waits_where_nothing_can_be_read_or_added(camera: Any, why: str) -> None:
    other = bpy.data.scenes.new("Other")
    running = Running()
    running.event()
    if why == "mode":
        running.context.mode = "EDIT_MESH"
    else:
        running.context.scene = other
    running.job.thread.join()
    for _ in range(3):
        assert running.event() == {"PASS_THROUGH"}
    assert "Camera 1" not in bpy.data.objects
    what = "object mode" if why == "mode" else "the scene Scene to be shown"
    assert running.manager.status == f"Echocast: waiting for {what}, Esc stops"
    running.context.mode, running.context.scene = "OBJECT", bpy.data.scenes["Scene"]
    assert running.to_the_end() == {"FINISHED"}
    assert "Camera 1" in bpy.data.objects and not other.objects


def test_scene_that_is_deleted_during_a_scan(camera: Any) -> None:
    running = Running()
    running.event()
    name = bpy.context.scene.name
    running.context.scene = bpy.data.scenes.new("Other")
    bpy.data.scenes.remove(bpy.data.scenes[name])
    assert running.to_the_end() == {"CANCELLED"}
    assert running.reports == [({"ERROR"}, f"the scene {name} is no longer there: what was scanned before remains")]


def test_another_file_that_is_opened_during_a_scan(camera: Any) -> None:
    """Blender then calls `cancel`."""
    running = Running()
    running.event()
    running.cancel(running.context)
    assert running.manager.timers == 0 and running.job.is_done() and not operators.EchocastScan.running


def test_job_that_is_stopped(camera: Any) -> None:
    job = operators.Job(scan.prepare(bpy.context, 1), images=True)
    job.stop()
    try:
        assert job.is_done() and len(job.results()) == 1
    except ec.CancelledError:
        pass


# --- other operators --------------------------------------------------------------------------------------------------


def test_add_sensor() -> None:
    bpy.context.scene.cursor.location = (1, 2, 3)
    assert bpy.ops.echocast.add_sensor(preset="ouster_os1_64") == {"FINISHED"}
    thing = bpy.context.object
    assert tuple(thing.location) == (1, 2, 3) and thing.select_get() and thing.type == "EMPTY"
    assert thing.echocast.is_sensor and thing.echocast.sensor().name == "ouster_os1_64"
    assert thing.name == ec.Sensor("ouster_os1_64").title
    bpy.ops.echocast.add_sensor()
    assert not thing.select_get() and bpy.context.object.echocast.preset == "velodyne_vlp16"


def test_add_unknown_sensor_adds_nothing() -> None:
    with pytest.raises(RuntimeError, match="Error: .*no_such"):
        bpy.ops.echocast.add_sensor(preset="no_such")
    assert not bpy.data.objects


def test_add_sensor_in_a_collection_that_is_excluded() -> None:
    hidden = bpy.data.collections.new("Hidden")
    bpy.context.scene.collection.children.link(hidden)
    layer = bpy.context.view_layer.layer_collection.children["Hidden"]
    bpy.context.view_layer.active_layer_collection = layer
    layer.exclude = True
    assert bpy.ops.echocast.add_sensor() == {"FINISHED"}
    assert len([one for one in bpy.data.objects if one.echocast.is_sensor]) == 1


@pytest.mark.parametrize("items", ["outputs", "layers"])
def test_edit_list(items: str) -> None:
    wanted = bpy.context.scene.echocast
    index = items[:-1]
    for count in (1, 2, 3):
        assert bpy.ops.echocast.edit_list(items=items, action="ADD") == {"FINISHED"}
        assert len(getattr(wanted, items)) == count and getattr(wanted, index) == count - 1
    if items == "layers":
        assert [one.depth for one in wanted.layers] == [0, 10, 20]
    setattr(wanted, index, 1)
    for count in (2, 1, 0, 0):
        bpy.ops.echocast.edit_list(items=items, action="REMOVE")
        assert len(getattr(wanted, items)) == count and 0 <= getattr(wanted, index) <= max(0, count - 1)
    bpy.ops.echocast.edit_list(items=items, action="ADD")
    setattr(wanted, index, 50)
    bpy.ops.echocast.edit_list(items=items, action="REMOVE")
    assert not getattr(wanted, items) and getattr(wanted, index) == 0


def test_show_section() -> None:
    thing = makers.sensor("velodyne_vlp16")
    bpy.context.view_layer.objects.active = thing
    for section in ("noise", ""):
        assert bpy.ops.echocast.show_section(section=section) == {"FINISHED"}
        assert thing.echocast.section == section
    bpy.context.view_layer.objects.active = None
    assert not bpy.ops.echocast.show_section.poll()


def select(thing: Any, index: "int | None") -> None:
    chosen = np.zeros(len(thing.data.vertices), dtype=bool)
    if index is not None:
        chosen[index] = True
    thing.data.vertices.foreach_set("select", chosen)
    bpy.context.view_layer.objects.active = thing


def test_explain(camera: Any) -> None:
    bpy.ops.echocast.scan()
    select(result(), 7)
    beam = int(column(result(), "beam")[7])
    assert bpy.ops.echocast.explain() == {"FINISHED"}
    text = bpy.data.texts[f"Camera 1, beam {beam}"].as_string()
    assert text.startswith(f"beam {beam}: ") and f"{column(result(), 'range')[7]:.3f}"[:4] in text
    # The same text is filled again.
    bpy.ops.echocast.explain()
    assert len(bpy.data.texts) == 1


def test_explain_a_point_of_an_earlier_frame(camera: Any) -> None:
    """As the scene was at that frame, which is not the last that was scanned."""
    timeline = bpy.context.scene
    timeline.frame_start, timeline.frame_end = 1, 2
    timeline.echocast.frames, timeline.echocast.motion = "RANGE", False
    for frame, x in ((1, 3.0), (2, 5.0)):
        bpy.data.objects["Wall"].location.x = x
        bpy.data.objects["Wall"].keyframe_insert("location", frame=frame)
    timeline.frame_set(2)
    bpy.ops.echocast.scan()
    point = int(column(result(), "range").argmin())
    select(result(), point)
    bpy.ops.echocast.explain()
    assert f"{column(result(), 'range')[point]:.3f}"[:4] in bpy.data.texts[0].as_string()
    assert timeline.frame_current == 2


def test_explain_in_edit_mode_and_after_loading(camera: Any, tmp_path: Path) -> None:
    bpy.ops.echocast.scan()
    select(result(), 3)
    bpy.ops.object.mode_set(mode="EDIT")
    assert bpy.ops.echocast.explain() == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    select(result(), 5)
    assert bpy.ops.echocast.explain() == {"FINISHED"}
    assert len(bpy.data.texts) == 2


@pytest.mark.parametrize("why", ["no_point", "no_sensor", "no_beam"])
def test_explain_says_why_it_cannot(camera: Any, why: str) -> None:
    bpy.ops.echocast.scan()
    select(result(), None if why == "no_point" else 3)
    if why == "no_sensor":
        camera.name = "Renamed"
    if why == "no_beam":
        result().data.attributes.remove(result().data.attributes["beam"])
    expected = {"no_point": "no point is selected", "no_sensor": "the sensor Camera", "no_beam": "have no beams"}[why]
    with pytest.raises(RuntimeError, match=expected):
        bpy.ops.echocast.explain()
    assert not bpy.data.texts


def test_explain_needs_a_cloud(camera: Any) -> None:
    bpy.context.view_layer.objects.active = bpy.data.objects["Wall"]
    assert not bpy.ops.echocast.explain.poll()


# --- settings of the paper's add-on -----------------------------------------------------------------------------------


def stored(**settings: Any) -> Any:
    """What its add-on leaves in a scene; returns its camera."""
    camera = bpy.data.objects.new("Scanner", bpy.data.cameras.new("Scanner"))
    bpy.context.scene.collection.objects.link(camera)
    camera.rotation_euler = (math.pi / 2, 0, -math.pi / 2)
    bpy.context.scene[paper.GROUP] = {"scannerCategory": 0, "joinMeshes": 0, **settings}
    bpy.context.scene[paper.GROUP]["scannerObject"] = camera
    return camera


def keys_of(camera: Any, *paths: str) -> "list[Any]":
    found = []
    for path in paths:
        keys: Any = camera.echocast.sensor().to_dict()
        for key in path.split("."):
            keys = keys[key]
        found.append(keys)
    return found


NO_NOISE = {"addNoise": 0, "addConstantNoise": 0}


def test_take_over_static() -> None:
    camera = stored(
        scannerType=0, fovX=70.0, fovY=60.0, resolutionX=200, resolutionY=100, resolutionPercentage=50,
        reflectivityLower=0.2, distanceLower=3.0, reflectivityUpper=0.7, distanceUpper=8.5, **NO_NOISE,
    )  # fmt: skip
    assert bpy.ops.echocast.take_over() == {"FINISHED"}
    resolution, fov, farthest = keys_of(camera, "pattern.resolution", "pattern.fov_deg", "range.max_m")
    assert resolution == [100, 50] and farthest == 8.5
    assert fov == pytest.approx([70, 2 * math.degrees(math.atan(60 / 70 * math.tan(math.radians(35))))], abs=1e-4)
    lower, upper = keys_of(camera, "detection.lower", "detection.upper")
    assert (lower, upper) == ({"reflectance": 0.2, "at_m": 3.0}, {"reflectance": 0.7, "at_m": 8.5})
    assert bpy.context.scene.echocast.profile == "blainder"
    assert not any(keys_of(camera, "noise")[0].values())
    makers.wall("Wall", 4, (3, 0, 0))
    assert len(makers.cloud("range,beam")) > 1000


def test_take_over_defaults() -> None:
    """Only what was set is stored."""
    camera = stored()
    bpy.ops.echocast.take_over()
    assert keys_of(camera, "pattern.resolution", "range.max_m", "noise.range_sigma_m") == [[320, 240], 120.0, 0.01]


def test_take_over_noise() -> None:
    constant = {"addConstantNoise": 1, "noiseAbsoluteOffset": 0.5, "noiseRelativeOffset": 10.0}
    camera = stored(scannerType=0, addNoise=1, mu=0.25, sigma=0.02, **constant)
    bpy.ops.echocast.take_over()
    paths = ("range_mean_m", "range_sigma_m", "range_offset_m", "range_offset_percent")
    assert keys_of(camera, *(f"noise.{path}" for path in paths)) == [0.25, 0.02, 0.5, 10.0]
    makers.wall("Wall", 8, (3, 0, 0))
    seen = makers.cloud("range,true_range,beam")
    error = seen.range - 1.1 * seen.true_range
    assert (np.mean(error), np.std(error)) == (pytest.approx(0.75, abs=0.01), pytest.approx(0.02, rel=0.1))
    bpy.context.scene.echocast.noise = False
    seen = makers.cloud("range,true_range,beam")
    assert np.allclose(seen.range, seen.true_range)


def test_take_over_rotating() -> None:
    camera = stored(
        scannerType=1, fovX=120.0, fovY=20.0, xStepDegree=0.5, yStepDegree=2.0, rotationsPerSecond=5.0, distanceUpper=60.0, **NO_NOISE
    )
    bpy.ops.echocast.take_over()
    azimuth, elevation, farthest = keys_of(camera, "pattern.azimuth", "pattern.elevation", "range.max_m")
    assert (azimuth["fov_deg"], azimuth["step_deg"], azimuth["rate_hz"]) == (120.0, 0.5, 5.0)
    assert (elevation["fov_deg"], elevation["step_deg"], farthest) == (20.0, 2.0, 60.0)


@pytest.mark.parametrize("physical", [True, False])
def test_take_over_side_scan_with_layers_of_water(physical: bool) -> None:
    """The paper's preset has indices of refraction where others have speeds."""
    camera = stored(
        scannerType=2, fovSonar=60.0, sonarStepDegree=1.5, sourceLevel=210.0, noiseLevel=40.0, directivityIndex=15.0,
        processingGain=5.0, receptionThreshold=12.0, maxDistance=80.0, simulateWaterProfile=1, surfaceHeight=2.0,
    )  # fmt: skip
    speeds = (1500.0, 1480.0) if physical else (1.333, 1.5)
    densities = (1025.0, 1030.0) if physical else (1.333, 1.4)
    rows = [{"name": str(depth), "depth": depth, "speed": speed, "density": density}
        for depth, speed, density in zip((0.0, 4.0), speeds, densities)]
    # In another order than that of the depths.
    bpy.context.scene["custom"] = rows[::-1]
    bpy.ops.echocast.take_over()
    paths = ("source_level_db", "noise_level_db", "directivity_index_db", "processing_gain_db", "detection_threshold_db")
    assert keys_of(camera, *(f"acoustics.{path}" for path in paths)) == [210.0, 40.0, 15.0, 5.0, 12.0]
    assert keys_of(camera, "pattern.down_fov_deg", "pattern.step_deg", "range.max_m") == [60.0, 1.5, 80.0]
    wanted = bpy.context.scene.echocast
    water = wanted.environment(1.0).to_dict()["water"]
    assert wanted.water and water["surface_z_m"] == 2.0
    assert [row["depth_m"] for row in water["profile"]["layers"]] == [0.0, 4.0]
    assert [row["speed_m_s"] for row in water["profile"]["layers"]] == pytest.approx(speeds)
    assert [row["density_kg_m3"] for row in water["profile"]["layers"]] == pytest.approx(densities)
    assert len(wanted.layers) == (2 if physical else 0)
    makers.plane("Bed", 60, (0, 0, -8))
    assert len(makers.cloud("range,beam")) > 10


def test_take_over_weather_and_files(tmp_path: Path) -> None:
    camera = stored(
        scannerType=1, simulateRain=1, rainfallRate=25.0, simulateDust=1, particleRadius=40.0, particlesPcm=2e5, dustCloudStart=3.0,
        dustCloudLength=4.5, enableAnimation=1, frameStart=1, frameEnd=10, frameStep=3, exportLAS=1, exportPLY=1, exportHDF=1,
        exportCSV=0, dataFilePath=str(tmp_path),
    )  # fmt: skip
    bpy.ops.echocast.take_over()
    wanted = bpy.context.scene.echocast
    keys = wanted.environment(1.0).to_dict()
    (rain,), (dust,) = keys["rain"], keys["dust"]
    assert wanted.rain and rain["rate_mm_h"] == 25.0
    assert {key: dust[key] for key in ("radius_um", "per_m3", "start_m", "length_m")} == {
        "radius_um": 40.0, "per_m3": 2e5, "start_m": 3.0, "length_m": 4.5,
    }  # fmt: skip
    assert (wanted.frames, wanted.step) == ("RANGE", 3)
    assert {(one.format, one.path) for one in wanted.outputs} == {(name, str(tmp_path)) for name in ("las", "ply", "hdf5")}
    assert any("frames 1 to 10" in note for note in json.loads(wanted.notes))
    bpy.context.scene.frame_end = 1
    makers.wall("Wall", 8, (3, 0, 0))
    bpy.ops.echocast.scan()
    assert {path.name for path in tmp_path.iterdir()} >= {"Scanner_0001.las", "Scanner_0001.ply", "Scanner_0001.h5"}
    assert camera.echocast.is_sensor


@pytest.mark.parametrize(
    "settings",
    [{"resolutionPercentage": 50.0}, {"fovX": "wide"}, {"xMin": 3.0, "refDepth": "0"}, {"addNoise": "yes", "sigma": [1.0, 2.0]}],
    ids=json.dumps,
)
def test_take_over_values_of_another_type(settings: "dict[str, Any]") -> None:
    """They are those of older versions: their defaults are used, as Blender would."""
    camera = stored(**settings)
    assert bpy.ops.echocast.take_over() == {"FINISHED"}
    half = "resolutionPercentage" in settings
    assert keys_of(camera, "pattern.resolution", "noise.range_sigma_m") == [[160, 120] if half else [320, 240], 0.01]
    assert keys_of(camera, "pattern.fov_deg")[0][0] == 90.0


@pytest.mark.parametrize("why", ["nothing", "no_camera", "unknown_type", "has_a_sensor"])
def test_take_over_that_cannot_be(why: str) -> None:
    if why != "nothing":
        camera = stored(scannerType=9 if why == "unknown_type" else 0)
        if why == "no_camera":
            bpy.data.objects.remove(camera)
        if why == "has_a_sensor":
            makers.sensor("velodyne_vlp16")
    expected = {"CANCELLED"} if why in ("nothing", "has_a_sensor") else {"FINISHED"}
    assert bpy.ops.echocast.take_over() == expected
    assert sum(one.echocast.is_sensor for one in bpy.data.objects) == (why == "has_a_sensor")


def test_take_over_when_a_file_is_loaded(tmp_path: Path, capsys: Any) -> None:
    stored(scannerType=1)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "theirs.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "theirs.blend"))
    assert bpy.data.objects["Scanner"].echocast.preset == "generic_lidar"
    assert "the camera Scanner is a sensor with the settings of the BLAINDER range scanner" in capsys.readouterr().out
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "theirs.blend"))
    assert "BLAINDER" not in capsys.readouterr().out


# --- the add-on itself ------------------------------------------------------------------------------------------------


@pytest.mark.skipif(bool(bpy.app.binary_path) or bpy.app.version < (4, 3), reason="4.2 crashes when Python ends")
def test_scripts_with_the_module_end() -> None:
    folders = [str(Path(module.__file__).parents[1]) for module in (echocast_blender, ec)]
    script = f"import sys; sys.path[:0] = {folders}; import bpy, echocast_blender; echocast_blender.batch.enable()"
    assert subprocess.run([sys.executable, "-c", script], timeout=60).returncode == 0


def test_select_sensor(camera: Any) -> None:
    other = makers.sensor("velodyne_vlp16", "Other")
    assert bpy.ops.echocast.select(name="Other") == {"FINISHED"}
    assert bpy.context.view_layer.objects.active == other


def test_add_on_is_switched_off_and_on(camera: Any) -> None:
    handlers = {name: len(getattr(bpy.app.handlers, name)) for name in dir(bpy.app.handlers) if name.endswith(("_post", "_pre"))}
    echocast_blender.unregister()
    assert not hasattr(bpy.types.Scene, "echocast") and not hasattr(bpy.types, "ECHOCAST_OT_scan")
    echocast_blender.register()
    assert {name: len(getattr(bpy.app.handlers, name)) for name in handlers} == handlers
    # What it has stored in the file is there again.
    assert bpy.data.objects["Camera"].echocast.is_sensor
    assert bpy.ops.echocast.scan() == {"FINISHED"}
