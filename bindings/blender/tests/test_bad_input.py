"""Bad input: one sentence, and the file as it was."""

import json
import math
import os
from pathlib import Path
from typing import Any

import bpy
import echocast as ec
import makers
import numpy as np
import pytest
import test_materials
from echocast_blender import clouds, scene


@pytest.fixture
def camera(tmp_path: Path) -> Any:
    return makers.sensor(makers.write_sensor(tmp_path / "camera.yaml"), "Camera")


def refused(match: str, operator: Any = None) -> None:
    """Checks that a scan says why it cannot be, in one sentence, and changes nothing."""
    before = makers.fingerprint()
    with pytest.raises(RuntimeError) as error:
        (operator or bpy.ops.echocast.scan)()
    said = str(error.value).strip()
    assert said.startswith("Error: ") and "\n" not in said and "Traceback" not in said
    assert match in said and said.count("Error:") == 1
    assert not makers.differences(before)


def scanned() -> "list[str]":
    """Scans; returns what is noted."""
    assert bpy.ops.echocast.scan() == {"FINISHED"}
    return json.loads(bpy.context.scene.echocast.notes)


def good_wall() -> Any:
    return makers.wall("Good", 2, (4, 0, 0))


# --- sensors ----------------------------------------------------------------------------------------------------------


def test_no_sensor() -> None:
    good_wall()
    refused("the scene has no sensor")


def test_no_sensor_that_is_enabled(camera: Any) -> None:
    good_wall()
    camera.echocast.enabled = False
    refused("the scene has no sensor")


def test_sensor_without_a_preset(camera: Any) -> None:
    good_wall()
    camera.echocast.preset = ""
    refused("sensor Camera: the sensor Camera has no preset")


def test_sensor_whose_file_is_gone(camera: Any, tmp_path: Path) -> None:
    good_wall()
    makers.parameter(camera, "pattern.rate_hz").number = 5.0
    (tmp_path / "camera.yaml").unlink()
    refused("camera.yaml")


@pytest.mark.parametrize("place", [math.nan, math.inf])
def test_sensor_that_is_nowhere(camera: Any, place: float) -> None:
    good_wall()
    camera.location.x = place
    if math.isnan(place):
        refused("Camera is at a place that is not of numbers")
    else:
        # Blender makes the largest number of it: nothing is in sight from there.
        assert "Camera: no beam has a return" in scanned()[0]


@pytest.mark.parametrize("scale", [(0, 1, 1), (0, 0, 0), (1e-30, 1e-30, 1e-30), (-1, 1, 1)])
def test_sensor_without_size(camera: Any, scale: Any) -> None:
    good_wall()
    camera.scale = scale
    scanned()
    assert len(bpy.data.objects["Camera 1"].data.vertices) > 100


def test_two_sensors_with_one_file_name(camera: Any, tmp_path: Path) -> None:
    good_wall()
    makers.sensor(camera.echocast.preset, "Front left")
    makers.sensor(camera.echocast.preset, "Front/left")
    bpy.context.scene.echocast.outputs.add().path = str(tmp_path / "out")
    refused("have the same file name, Front_left")
    assert not (tmp_path / "out").exists()


# --- meshes -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("why", ["nothing", "empties", "no_faces", "no_vertices", "hidden", "curve_without_a_surface"])
def test_nothing_to_scan(camera: Any, why: str) -> None:
    if why == "empties":
        makers.empty("Empty")
    elif why == "no_faces":
        makers.thing("Points", [(4, 0, 0), (4, 1, 0), (4, 0, 1)], [])
    elif why == "no_vertices":
        makers.thing("Void", [], [])
    elif why == "hidden":
        good_wall().hide_render = True
    elif why == "curve_without_a_surface":
        curve = bpy.data.curves.new("Line", "CURVE")
        curve.splines.new("POLY").points.add(3)
        bpy.context.scene.collection.objects.link(bpy.data.objects.new("Line", curve))
    refused("nothing in the scene can be scanned: no visible object has a face")


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e30])
def test_vertex_that_is_nowhere(camera: Any, value: float) -> None:
    bad = makers.wall("Bad", 2, (3, 0, 0))
    bad.data.vertices[1].co.y = value
    bad.data.update()
    refused("Bad is left out")
    good_wall()
    (note,) = scanned()
    assert note.startswith("Bad is left out: ")
    assert set(bpy.data.objects["Camera 1"]["categories"].to_dict().values()) == {"Good"}
    bad.data.vertices[1].co.y = -1
    bad.data.update()
    assert not scanned()


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e30])
def test_object_that_is_nowhere(camera: Any, value: float) -> None:
    bad = makers.wall("Bad", 2, (3, 0, 0))
    bad.location.x = value
    refused("Bad is left out: its matrix has numbers that are not finite, or above 1e+12")
    good_wall()
    assert scanned() == ["Bad is left out: its matrix has numbers that are not finite, or above 1e+12"]
    bad.location.x = 3
    assert not scanned()


@pytest.mark.parametrize("scale", [(0, 1, 1), (0, 0, 0), (1e-30, 1, 1)])
def test_object_without_size(camera: Any, scale: Any) -> None:
    good_wall()
    makers.wall("Flat", 1, (3, 0, 0)).scale = scale
    scanned()
    assert len(bpy.data.objects["Camera 1"].data.vertices) > 100


def test_face_without_area(camera: Any) -> None:
    good_wall()
    makers.thing("Line", [(3, 0, 0), (3, 1, 0), (3, 2, 0)], [(0, 1, 2)])
    makers.thing("Point", [(3, 0, 0)] * 3, [(0, 1, 2)])
    scanned()
    assert len(bpy.data.objects["Camera 1"].data.vertices) > 100


def test_texture_coordinates_that_are_no_numbers(camera: Any) -> None:
    made = makers.material()
    node = made.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = makers.image("Checks", np.ones((2, 2, 3)))
    made.node_tree.links.new(node.outputs["Color"], makers.principled(made).inputs["Base Color"])
    wall = makers.wall("Wall", 2, (3, 0, 0), made)
    wall.data.uv_layers[0].data.foreach_set("uv", [math.nan, math.inf, -math.inf, 1e38] * 2)
    scanned()


def test_names_of_all_kinds(camera: Any, tmp_path: Path) -> None:
    for index, name in enumerate(("Stühle 椅子", " ", "a/b\\c:d", "x" * 63, "'\"", "{sensor}")):
        makers.wall(name, 0.2, (3, index - 2.5, 0))
    camera.name = "//..\\ Kamera 相机"
    output = bpy.context.scene.echocast.outputs.add()
    output.format, output.path = "csv", str(tmp_path / "out" / "{sensor}")
    scanned()
    (path,) = (tmp_path / "out").rglob("*.csv")
    assert path.parent.parent == tmp_path / "out" and len(ec.read_cloud(path)[0])


# --- materials and other data -----------------------------------------------------------------------------------------


class Gone(bpy.types.ShaderNode):
    bl_idname, bl_label = "EchocastTestGone", "Gone"

    def init(self, _context: Any) -> None:
        self.outputs.new("NodeSocketColor", "Color")


@pytest.mark.parametrize("why", ["no_group", "unknown_node", "itself", "circle"])
def test_node_trees_that_cannot_be_read(camera: Any, why: str) -> None:
    made = makers.material("Odd")
    tree = made.node_tree
    paint = makers.principled(made).inputs["Base Color"]
    if why == "no_group":
        group, _, _ = test_materials.group("Group", {}, {"Paint": "NodeSocketColor"})
        tree.links.new(test_materials.put(made, group).outputs[0], paint)
        bpy.data.node_groups.remove(group)
    elif why == "unknown_node":
        bpy.utils.register_class(Gone)
        tree.links.new(tree.nodes.new(Gone.bl_idname).outputs[0], paint)
        bpy.utils.unregister_class(Gone)
    elif why == "itself":
        # Blender refuses it.
        group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
        group.nodes.new("ShaderNodeGroup").node_tree = group
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = group
    else:
        first, second = (tree.nodes.new("ShaderNodeInvert") for _ in range(2))
        tree.links.new(first.outputs[0], second.inputs["Color"])
        tree.links.new(second.outputs[0], first.inputs["Color"])
        tree.links.new(second.outputs[0], paint)
    makers.wall("Wall", 2, (3, 0, 0), made)
    # Blender 5.3 removes the links of a group that is gone.
    linked = paint.is_linked
    notes = scanned()
    assert all(note.startswith("material Odd: ") for note in notes)
    assert bool(notes) == linked


def test_libraries_that_are_missing(camera: Any, tmp_path: Path) -> None:
    """An object, a collection, a mesh and a material are linked from a file that is gone."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    thing = makers.cube("Linked", 1, (3, 0, 0), makers.material("Linked paint"))
    bpy.context.scene.collection.children.link(makers.collection("Linked things", thing))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, to):
        to.collections, to.meshes, to.materials = ["Linked things"], ["Linked"], ["Linked paint"]
    instancer = makers.empty("Instancer")
    instancer.instance_type, instancer.instance_collection = "COLLECTION", bpy.data.collections["Linked things"]
    user = bpy.data.objects.new("User", bpy.data.meshes["Linked"])
    bpy.context.scene.collection.objects.link(user)
    good_wall().data.materials.append(bpy.data.materials["Linked paint"])
    makers.sensor(makers.write_sensor(tmp_path / "camera.yaml"), "Camera")
    assert not scanned()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    (tmp_path / "library.blend").unlink()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    missing = f"the library {tmp_path / 'library.blend'} is missing: what it holds is not seen"
    assert missing in scanned()
    bpy.data.objects.remove(bpy.data.objects["Good"])
    refused("nothing in the scene can be scanned")


def test_active_collection_of_a_library(tmp_path: Path) -> None:
    bpy.context.scene.collection.children.link(makers.collection("Linked things", makers.cube()))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, to):
        to.collections = ["Linked things"]
    bpy.context.scene.collection.children.link(bpy.data.collections["Linked things"])
    bpy.context.view_layer.active_layer_collection = bpy.context.view_layer.layer_collection.children["Linked things"]
    assert bpy.ops.echocast.add_sensor() == {"FINISHED"}
    assert bpy.context.object.echocast.is_sensor
    assert scanned() is not None


# --- settings ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("columns", ["nonsense", "range,nonsense", "range;intensity"])
def test_unknown_columns(camera: Any, columns: str) -> None:
    good_wall()
    bpy.context.scene.echocast.columns = columns
    refused("nonsense" if "nonsense" in columns else "range;intensity")


@pytest.mark.parametrize("columns", ["", ",", "default,,intensity", " range , intensity ", "intensity"])
def test_columns_with_blanks_or_few(camera: Any, columns: str) -> None:
    good_wall()
    bpy.context.scene.echocast.columns = columns
    scanned()
    assert ("intensity" in bpy.data.objects["Camera 1"].data.attributes) == (columns != ",")
    assert len(bpy.data.images) == 2


@pytest.mark.parametrize("text", ["fog: {visibility_m: far}", "fogg: {}", "{", "- 1", "rain: {rate_mm_h: -1}"])
def test_environment_that_is_wrong(camera: Any, text: str) -> None:
    good_wall()
    page = bpy.data.texts.new("Weather")
    page.from_string(text)
    bpy.context.scene.echocast.keys = page
    refused("the text Weather: ")


@pytest.mark.parametrize("where", ["above", "layers"])
def test_sonar_that_is_not_in_the_water(where: str) -> None:
    makers.plane("Bed", 40, (0, 0, -8))
    makers.sensor("mbes_400", "Sonar", (0, 0, 3 if where == "above" else -1))
    wanted = bpy.context.scene.echocast
    wanted.water = True
    if where == "layers":
        layer = wanted.layers.add()
        layer.depth = 5.0
    refused("depth of the sonar" if where == "above" else "")


def test_layers_at_one_depth() -> None:
    makers.plane("Bed", 40, (0, 0, -8))
    makers.sensor("mbes_400", "Sonar", (0, 0, -1))
    wanted = bpy.context.scene.echocast
    wanted.water = True
    for _ in range(2):
        wanted.layers.add()
    refused("depth_m")


@pytest.mark.parametrize("path", ["//out", "{file}/out", "/proc/out", "", "  "])
def test_folders_that_cannot_be_written(camera: Any, tmp_path: Path, path: str) -> None:
    good_wall()
    (tmp_path / "file").write_text("")
    output = bpy.context.scene.echocast.outputs.add()
    output.format = "csv"
    output.path = path.replace("{file}", str(tmp_path / "file"))
    words = {"//": "which is not saved", "": "has no folder", "  ": "has no folder", "/p": "/proc/out"}
    refused(words.get(path[:2], "is not a folder in which files can be made"))


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes anywhere")
def test_folder_without_permission(camera: Any, tmp_path: Path) -> None:
    good_wall()
    (tmp_path / "closed").mkdir(mode=0o500)
    bpy.context.scene.echocast.outputs.add().path = str(tmp_path / "closed" / "out")
    refused("is not a folder in which files can be made")


def test_format_of_another_version(camera: Any, tmp_path: Path) -> None:
    good_wall()
    output = bpy.context.scene.echocast.outputs.add()
    output.path = str(tmp_path)
    kept = output.bl_system_properties_get(do_create=True) if hasattr(output, "bl_system_properties_get") else output
    kept["format"] = 99
    refused("format of another version")


def test_file_that_cannot_be_written_leaves_the_scene_as_it_was(camera: Any, tmp_path: Path) -> None:
    """A folder stands where the file should be: found out only after the scan."""
    good_wall()
    output = bpy.context.scene.echocast.outputs.add()
    output.format, output.path = "csv", str(tmp_path)
    (tmp_path / "Camera_0001.csv").mkdir()
    refused("Camera_0001.csv")


def test_later_frame_that_fails_keeps_what_was_scanned(camera: Any) -> None:
    """Otherwise it would be there, and undo would not take it away."""
    wall = good_wall()
    timeline = bpy.context.scene
    timeline.frame_start, timeline.frame_end, timeline.echocast.frames, timeline.echocast.motion = 1, 3, "RANGE", False
    for frame, hidden in ((1, False), (2, False), (3, True)):
        wall.hide_render = hidden
        wall.keyframe_insert("hide_render", frame=frame)
    timeline.frame_set(2)
    with pytest.raises(RuntimeError, match="nothing in the scene can be scanned"):
        bpy.ops.echocast.scan()
    assert [one.name for one in bpy.data.objects if scene.RESULT in one] == ["Camera 1", "Camera 2"]
    assert timeline.frame_current == 2


def test_frames_before_the_start(camera: Any) -> None:
    camera.keyframe_insert("location", frame=1)
    good_wall()
    bpy.context.scene.frame_set(-5)
    scanned()
    assert "Camera -5" in bpy.data.objects


@pytest.mark.parametrize("mode", ["EDIT", "SCULPT", "VERTEX_PAINT"])
def test_other_modes(camera: Any, mode: str) -> None:
    wall = good_wall()
    bpy.context.view_layer.objects.active = wall
    bpy.ops.object.mode_set(mode=mode)
    for operator in (bpy.ops.echocast.scan, bpy.ops.echocast.add_sensor):
        with pytest.raises(RuntimeError, match=r"the mode is \w+; allowed: OBJECT"):
            operator()


@pytest.mark.parametrize("value", ["nonsense", 5, "[1]", "{}"])
def test_cloud_whose_property_was_changed(camera: Any, value: Any) -> None:
    good_wall()
    scanned()
    cloud = bpy.data.objects["Camera 1"]
    cloud[scene.RESULT] = value
    bpy.context.view_layer.objects.active = cloud
    cloud.data.vertices[0].select = True
    refused("does not say what scan it is of", bpy.ops.echocast.explain)
    scanned()
    assert len([one for one in bpy.data.objects if scene.RESULT in one]) == 2


def test_things_that_others_have_named_like_results(camera: Any) -> None:
    good_wall()
    makers.empty("Camera 1").hide_render = True
    mine = makers.image("Camera 1 depth", np.full((3, 3, 3), 0.5))
    before = makers.fingerprint()
    scanned()
    changed = makers.differences(before)
    assert not any(one.startswith(("objects/Camera 1/", "images/Camera 1 depth/")) for one in changed)
    assert clouds.RANGE not in mine
    scanned()
    assert len([one for one in bpy.data.objects if scene.RESULT in one]) == 1
    assert len([one for one in bpy.data.images if clouds.RANGE in one]) == 2


@pytest.mark.parametrize("setting", ["layer_not_rendered", "stereo", "border", "no_layers", "own_engine"])
def test_rendering_that_is_set_up_otherwise(camera: Any, setting: str) -> None:
    """What only rendering shows is read by rendering."""
    wall = good_wall()
    wall.hide_set(True)
    timeline = bpy.context.scene
    render = timeline.render
    if setting == "layer_not_rendered":
        bpy.context.view_layer.use = False
    elif setting == "stereo":
        render.use_multiview = True
    elif setting == "border":
        render.use_border, render.border_max_x, render.border_max_y = True, 0.0, 0.0
    elif setting == "no_layers":
        render.use_single_layer = True
        timeline.view_layers.new("Other").use = False
    else:
        render.engine = "CYCLES"
    before = makers.fingerprint()
    assert set(makers.cloud().categories.values()) == {"Good"}
    assert not makers.differences(before)


class Red(bpy.types.RenderEngine):
    bl_idname, bl_label = "ECHOCAST_TEST_RED", "Red"

    def render(self, _depsgraph: Any) -> None:
        result = self.begin_result(0, 0, 16, 16)
        result.layers[0].passes["Combined"].rect = [(1.0, 0.0, 0.0, 1.0)] * 256
        self.end_result(result)


@pytest.mark.parametrize("slot", [0, 7])
def test_picture_that_was_rendered_is_kept(camera: Any, tmp_path: Path, slot: int) -> None:
    good_wall().hide_set(True)
    timeline = bpy.context.scene
    timeline.camera = bpy.data.objects.new("View", bpy.data.cameras.new("View"))
    timeline.collection.objects.link(timeline.camera)
    timeline.render.resolution_x = timeline.render.resolution_y = 16
    bpy.utils.register_class(Red)
    try:
        timeline.render.engine = Red.bl_idname
        bpy.ops.render.render()
        picture = bpy.data.images["Render Result"]
        picture.render_slots.active_index = slot
        bpy.ops.render.render()
        picture.save_render(str(tmp_path / "before.png"))
        scanned()
        assert picture.render_slots.active_index == slot
        picture.save_render(str(tmp_path / "after.png"))
        assert (tmp_path / "after.png").read_bytes() == (tmp_path / "before.png").read_bytes()
    finally:
        timeline.render.engine = "CYCLES"
        bpy.utils.unregister_class(Red)


@pytest.mark.slow
def test_ten_million_faces(camera: Any) -> None:
    side = 3163
    count = side * side
    mesh = bpy.data.meshes.new("Large")
    mesh.vertices.add((side + 1) ** 2)
    y, z = np.meshgrid(np.linspace(-5, 5, side + 1, dtype=np.float32), np.linspace(-5, 5, side + 1, dtype=np.float32))
    mesh.vertices.foreach_set("co", np.stack([np.full_like(y, 4), y, z], axis=2).ravel())
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)[None, :]).ravel().astype(np.int32)
    mesh.loops.add(4 * count)
    mesh.loops.foreach_set("vertex_index", np.stack([first, first + 1, first + side + 2, first + side + 1], axis=1).ravel())
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 4 * count, 4, dtype=np.int32))
    if bpy.app.version < (3, 6):
        mesh.polygons.foreach_set("loop_total", np.full(count, 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Large", mesh))
    try:
        bpy.ops.echocast.scan()
    except RuntimeError as error:
        # There may not be enough memory.
        assert "Traceback" not in str(error) and "memory" in str(error)
    else:
        assert len(bpy.data.objects["Camera 1"].data.vertices) == 32 * 24
