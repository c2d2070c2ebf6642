"""Materials: what scans see of node trees, images, custom properties and slots."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import echocast as ec
import makers
import numpy as np
import pytest
from mathutils import Euler, Vector

COLUMNS = "range,intensity,cause,red,green,blue,material_id,x,y,z"
BACKDROP = {"name": "Backdrop", "reflectance": 0.5, "base_color": [0.2, 0.2, 0.2]}
TRANSMISSION = "Transmission" if bpy.app.version < (4, 0) else "Transmission Weight"


@pytest.fixture
def camera(tmp_path: Path) -> Any:
    """A camera at the origin that looks along x at a backdrop."""
    backdrop = makers.material("Backdrop")
    makers.principled(backdrop).inputs["Base Color"].default_value = (0.2, 0.2, 0.2, 1)
    backdrop["reflectance"] = 0.5
    makers.wall("Backdrop", 12, (6, 0, 0), backdrop)
    return makers.sensor(makers.write_sensor(tmp_path / "camera.yaml"))


def tilted(*materials: Any) -> Any:
    """A wall before the camera, turned so that a mirror shows nothing of the camera."""
    made = makers.wall("Wall", 2, (3, 0, 0), *materials)
    made.rotation_euler.z = math.radians(20)
    return made


def reference(camera: Any, turn: float, material: ec.Material) -> ec.PointCloud:
    """The scene of `tilted`, made without Blender."""
    live = ec.LiveScene()
    for half, x, angle, made in ((6, 6, 0, ec.Material(BACKDROP)), (1, 3, turn, material)):
        corners = np.array([(0, half, -half), (0, -half, -half), (0, -half, half), (0, half, half)], dtype=np.float32)
        pose = np.eye(4)
        pose[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
        pose[0, 3] = x
        live.add_mesh(ec.Mesh(corners, [[0, 1, 2], [0, 2, 3]], materials=[made]), pose=pose)
    return live.scan(camera.echocast.sensor(), at=ec.Pose(), fields=COLUMNS + ",beam", seed=0, frame=1, start_time=1 / 24)


def same(one: ec.PointCloud, other: ec.PointCloud) -> bool:
    if len(one) != len(other):
        return False
    near = all(np.allclose(one[name], other[name], atol=2e-3) for name in ("range", "intensity"))
    colors = all(np.abs(one[name].astype(int) - other[name]).max() <= 1 for name in ("red", "green", "blue"))
    return near and colors and np.array_equal(one["cause"], other["cause"])


# --- shaders ----------------------------------------------------------------------------------------------------------

PLAIN = {"base_color": [0.8, 0.8, 0.8, 1], "roughness": 0.5, "ior": 1.5, "metallic": 0, "transmission": 0}


@pytest.mark.parametrize(
    ("inputs", "keys"),
    [
        ({"Base Color": (0.8, 0.1, 0.05, 1)}, {"base_color": [0.8, 0.1, 0.05, 1]}),
        ({"Metallic": 1.0, "Roughness": 0.6}, {"metallic": 1, "roughness": 0.6}),
        ({"Metallic": 1.0, "Roughness": 0.0}, {"metallic": 1, "roughness": 0}),
        ({TRANSMISSION: 0.9, "Roughness": 0.0}, {"transmission": 0.9, "roughness": 0}),
        ({TRANSMISSION: 0.9, "Roughness": 0.0, "IOR": 2.2}, {"transmission": 0.9, "roughness": 0, "ior": 2.2}),
        ({"Alpha": 0.4}, {"base_color": [0.8, 0.8, 0.8, 0.4], "alpha": "coverage"}),
    ],
    ids=lambda value: "-".join(value).replace(" ", "_"),
)
def test_sockets_of_principled(camera: Any, inputs: "dict[str, Any]", keys: "dict[str, Any]") -> None:
    made = makers.material()
    makers.principled(made).inputs["IOR"].default_value = 1.5
    tilted(made)
    before = makers.cloud(COLUMNS)
    for name, value in inputs.items():
        makers.principled(made).inputs[name].default_value = value
    after = makers.cloud(COLUMNS)
    turn = math.radians(20)
    assert same(before, reference(camera, turn, ec.Material({"name": "Sample", **PLAIN})))
    assert same(after, reference(camera, turn, ec.Material({"name": "Sample", **PLAIN, **keys})))
    assert not same(before, after)


def nodes_of(made: Any) -> "tuple[Any, Any]":
    """The nodes and links of a material, which has no shader."""
    tree = made.node_tree
    tree.nodes.remove(makers.principled(made))
    return tree.nodes, tree.links


def shader(made: Any, kind: str, **inputs: Any) -> Any:
    node = made.node_tree.nodes.new(kind)
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    return node


RED, GREEN = (0.8, 0.1, 0.1, 1), (0.1, 0.7, 0.1, 1)
CLEAR = {"Color": (1, 1, 1, 1), "Roughness": 0.0, "IOR": 1.6}


@pytest.mark.parametrize(
    ("kind", "inputs", "keys", "told"),
    [
        ("ShaderNodeBsdfDiffuse", {"Color": RED}, {"base_color": [0.8, 0.1, 0.1]}, ""),
        ("ShaderNodeBsdfGlass", CLEAR, {"transmission": 1, "roughness": 0, "ior": 1.6}, ""),
        ("ShaderNodeBsdfRefraction", CLEAR, {"transmission": 1, "roughness": 0, "ior": 1.6}, ""),
        ("ShaderNodeBsdfGlossy", {"Color": RED, "Roughness": 0.3}, {"base_color": RED[:3], "metallic": 1, "roughness": 0.3}, ""),
        ("ShaderNodeBsdfTranslucent", {"Color": GREEN}, {"base_color": [0.1, 0.7, 0.1]}, ""),
        ("ShaderNodeSubsurfaceScattering", {"Color": GREEN}, {"base_color": [0.1, 0.7, 0.1]}, ""),
        ("ShaderNodeEmission", {"Color": RED}, {"base_color": [0.8, 0.1, 0.1]}, "emits is not seen"),
        ("ShaderNodeBsdfTransparent", {}, {"base_color": [1, 1, 1, 0], "alpha": "coverage"}, ""),
        ("ShaderNodeBsdfHair", {}, {"base_color": [0.8, 0.8, 0.8]}, "is not read: grey"),
    ],
)
def test_other_shaders(camera: Any, kind: str, inputs: "dict[str, Any]", keys: "dict[str, Any]", told: str) -> None:
    made = makers.material()
    _, links = nodes_of(made)
    links.new(shader(made, kind, **inputs).outputs[0], makers.output(made).inputs["Surface"])
    tilted(made)
    expected = reference(camera, math.radians(20), ec.Material({"name": "Sample", "base_color": [1, 1, 1], **keys}))
    assert same(makers.cloud(COLUMNS), expected)
    said = makers.notes()
    assert told in said[0] if told else not said


def mix(made: Any, first: Any, second: Any, factor: float) -> Any:
    node = made.node_tree.nodes.new("ShaderNodeMixShader")
    node.inputs[0].default_value = factor
    for index, one in ((1, first), (2, second)):
        if one is not None:
            made.node_tree.links.new(one.outputs[0], node.inputs[index])
    made.node_tree.links.new(node.outputs[0], makers.output(made).inputs["Surface"])
    return node


@pytest.mark.parametrize("transparent_first", [True, False])
def test_mix_with_transparent_is_alpha(camera: Any, transparent_first: bool) -> None:
    made = makers.material()
    nodes_of(made)
    clear, solid = shader(made, "ShaderNodeBsdfTransparent"), shader(made, "ShaderNodeBsdfDiffuse", Color=RED)
    first, second = (clear, solid) if transparent_first else (solid, clear)
    mix(made, first, second, 0.3)
    tilted(made)
    alpha = 0.3 if transparent_first else 0.7
    keys = {"name": "Sample", "base_color": [0.8, 0.1, 0.1, alpha]}
    assert same(makers.cloud(COLUMNS), reference(camera, math.radians(20), ec.Material(keys, blend=True)))
    assert not makers.notes()


def test_mix_of_two_solid_shaders_is_in_between_and_told(camera: Any) -> None:
    made = makers.material()
    nodes_of(made)
    mix(made, shader(made, "ShaderNodeBsdfDiffuse", Color=RED), shader(made, "ShaderNodeBsdfDiffuse", Color=GREEN), 0.25)
    tilted(made)
    keys = {"name": "Sample", "base_color": [0.625, 0.25, 0.1]}
    assert same(makers.cloud(COLUMNS), reference(camera, math.radians(20), ec.Material(keys)))
    assert "approximated by one surface" in makers.notes()[0]


def test_mix_of_one_shader_is_that(camera: Any) -> None:
    made = makers.material()
    nodes_of(made)
    mix(made, None, shader(made, "ShaderNodeBsdfDiffuse", Color=GREEN), 0.25)
    tilted(made)
    keys = {"name": "Sample", "base_color": [0.1, 0.7, 0.1]}
    assert same(makers.cloud(COLUMNS), reference(camera, math.radians(20), ec.Material(keys)))


def test_sum_of_shaders_leaves_emission_out(camera: Any) -> None:
    made = makers.material()
    nodes, links = nodes_of(made)
    node = nodes.new("ShaderNodeAddShader")
    links.new(shader(made, "ShaderNodeEmission", Color=RED).outputs[0], node.inputs[0])
    links.new(shader(made, "ShaderNodeBsdfDiffuse", Color=GREEN).outputs[0], node.inputs[1])
    links.new(node.outputs[0], makers.output(made).inputs["Surface"])
    tilted(made)
    keys = {"name": "Sample", "base_color": [0.1, 0.7, 0.1]}
    assert same(makers.cloud(COLUMNS), reference(camera, math.radians(20), ec.Material(keys)))


def test_output_is_the_active_one_whatever_its_name() -> None:
    made = makers.material()
    tree = made.node_tree
    makers.output(made).name = "Materialausgabe"
    other = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader(made, "ShaderNodeBsdfDiffuse", Color=GREEN).outputs[0], other.inputs["Surface"])
    makers.principled(made).inputs["Base Color"].default_value = RED
    assert color_of(made) == RED[:3]
    for node in tree.nodes:
        if node.type == "OUTPUT_MATERIAL":
            node.is_active_output = node == other
    assert color_of(made) == GREEN[:3]


def test_without_an_output_it_is_grey_and_told(camera: Any) -> None:
    made = makers.material()
    made.node_tree.nodes.remove(makers.output(made))
    tilted(made)
    makers.cloud(COLUMNS)
    assert makers.notes() == ["material Sample: its node tree has no surface: grey"]


@pytest.mark.skipif(bpy.app.version >= (5, 0), reason="all materials have nodes")
def test_material_without_nodes(camera: Any) -> None:
    made = bpy.data.materials.new("Sample")
    made.diffuse_color = (0.3, 0.6, 0.2, 1)
    made.metallic, made.roughness = 1.0, 0.7
    tilted(made)
    keys = {"name": "Sample", "base_color": [0.3, 0.6, 0.2], "metallic": 1, "roughness": 0.7, "ior": 1.45}
    assert same(makers.cloud(COLUMNS), reference(camera, math.radians(20), ec.Material(keys)))


# --- values through nodes ---------------------------------------------------------------------------------------------


def encoded(channels: Any) -> Any:
    """sRGB of linear light, 0 to 255."""
    light = np.asarray(channels, dtype=float)
    return 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)


def color_of(made: Any) -> "tuple[float, ...]":
    """The base colour that a scan sees, linear, to two digits, of a material that has no image."""
    if "Wall" not in bpy.data.objects:
        tilted(made)
        keys = {**makers.CAMERA_KEYS}
        bpy.data.texts.new("camera").from_string(json.dumps(keys))
        makers.sensor(json.dumps(keys))
    seen = makers.cloud(COLUMNS)
    assert len(seen)
    found = np.array([seen[name][0] for name in ("red", "green", "blue")]) / 255
    return tuple(round(float(x), 2) for x in np.where(found <= 0.04045, found / 12.92, ((found + 0.055) / 1.055) ** 2.4))


def group(name: str, inputs: "dict[str, str]", outputs: "dict[str, str]") -> "tuple[Any, Any, Any]":
    """A node group with sockets by name and type, its input and its output node."""
    tree = bpy.data.node_groups.new(name, "ShaderNodeTree")
    for way, sockets in (("INPUT", inputs), ("OUTPUT", outputs)):
        for label, kind in sockets.items():
            if hasattr(tree, "interface"):
                tree.interface.new_socket(label, in_out=way, socket_type=kind)
            else:
                (tree.inputs if way == "INPUT" else tree.outputs).new(kind, label)
    return tree, tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")


def put(made: Any, tree: Any) -> Any:
    node = made.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = tree
    return node


def value_node(made: Any, color: Any) -> Any:
    node = made.node_tree.nodes.new("ShaderNodeRGB")
    node.outputs[0].default_value = color
    return node


def test_color_through_reroutes() -> None:
    made = makers.material()
    nodes, links = made.node_tree.nodes, made.node_tree.links
    source = value_node(made, RED).outputs[0]
    for _ in range(5):
        reroute = nodes.new("NodeReroute")
        links.new(source, reroute.inputs[0])
        source = reroute.outputs[0]
    links.new(source, makers.principled(made).inputs["Base Color"])
    assert color_of(made) == RED[:3]


@pytest.mark.parametrize("linked", [True, False])
def test_color_through_groups_in_groups(linked: bool) -> None:
    """From a value outside, into two groups, and out again."""
    inner, start, end = group("Inner", {"Paint": "NodeSocketColor"}, {"Paint": "NodeSocketColor"})
    inner.links.new(start.outputs[0], end.inputs[0])
    outer, start, end = group("Outer", {"Paint": "NodeSocketColor"}, {"Paint": "NodeSocketColor"})
    node = outer.nodes.new("ShaderNodeGroup")
    node.node_tree = inner
    outer.links.new(start.outputs[0], node.inputs[0])
    outer.links.new(node.outputs[0], end.inputs[0])
    made = makers.material()
    node = put(made, outer)
    node.inputs[0].default_value = GREEN
    if linked:
        made.node_tree.links.new(value_node(made, RED).outputs[0], node.inputs[0])
    made.node_tree.links.new(node.outputs[0], makers.principled(made).inputs["Base Color"])
    assert color_of(made) == (RED if linked else GREEN)[:3]


def test_shader_in_a_group_with_inputs_from_outside() -> None:
    tree, start, end = group("Paint", {"Paint": "NodeSocketColor"}, {"Shader": "NodeSocketShader"})
    inside = tree.nodes.new("ShaderNodeBsdfDiffuse")
    tree.links.new(start.outputs[0], inside.inputs["Color"])
    tree.links.new(inside.outputs[0], end.inputs[0])
    made = makers.material()
    node = put(made, tree)
    node.inputs[0].default_value = GREEN
    made.node_tree.links.new(node.outputs[0], makers.output(made).inputs["Surface"])
    assert color_of(made) == GREEN[:3]
    link = made.node_tree.links.new(value_node(made, RED).outputs[0], node.inputs[0])
    assert color_of(made) == RED[:3]
    # Without its link it has the value of the group's input outside, not that of the shader inside.
    link.is_muted = True
    made.node_tree.update_tag()
    assert color_of(made) == GREEN[:3]


def test_value_of_an_output_in_a_group_that_is_not_linked() -> None:
    tree, _, end = group("Constant", {}, {"Paint": "NodeSocketColor"})
    end.inputs[0].default_value = GREEN
    made = makers.material()
    made.node_tree.links.new(put(made, tree).outputs[0], makers.principled(made).inputs["Base Color"])
    assert color_of(made) == GREEN[:3]


def test_muted_link_is_none() -> None:
    made = makers.material(Base_Color=GREEN)
    link = made.node_tree.links.new(value_node(made, RED).outputs[0], makers.principled(made).inputs["Base Color"])
    assert color_of(made) == RED[:3]
    link.is_muted = True
    made.node_tree.update_tag()
    assert color_of(made) == GREEN[:3]


@pytest.mark.parametrize("kind", ["node", "group"])
def test_muted_nodes_pass_on(kind: str) -> None:
    made = makers.material()
    links = made.node_tree.links
    if kind == "node":
        between = made.node_tree.nodes.new("ShaderNodeInvert")
        source, sink = between.inputs["Color"], between.outputs[0]
    else:
        tree, _, end = group("Green", {"Paint": "NodeSocketColor"}, {"Paint": "NodeSocketColor"})
        end.inputs[0].default_value = GREEN
        between = put(made, tree)
        source, sink = between.inputs[0], between.outputs[0]
    links.new(value_node(made, RED).outputs[0], source)
    links.new(sink, makers.principled(made).inputs["Base Color"])
    between.mute = True
    made.node_tree.update_tag()
    assert color_of(made) == RED[:3]
    assert not makers.notes()


def mix_colors(made: Any, kind: str, factor: float, first: Any, second: Any, blend: str = "MIX") -> Any:
    """A node that mixes two colours, which are sockets or values."""
    node = made.node_tree.nodes.new(kind)
    if kind == "ShaderNodeMix":
        node.data_type = "RGBA"
    node.blend_type = blend
    inputs = [one for one in node.inputs if one.enabled]
    inputs[0].default_value = factor
    for socket, value in zip(inputs[1:], (first, second)):
        if isinstance(value, tuple):
            socket.default_value = value
        else:
            made.node_tree.links.new(value, socket)
    out = next(one for one in node.outputs if one.enabled)
    made.node_tree.links.new(out, makers.principled(made).inputs["Base Color"])
    return node


@pytest.mark.parametrize("kind", ["ShaderNodeMixRGB", "ShaderNodeMix"])
@pytest.mark.parametrize(
    ("blend", "factor", "expected"),
    [
        ("MIX", 0.25, (0.62, 0.25, 0.1)),
        ("MIX", 0.0, (0.8, 0.1, 0.1)),
        ("MIX", 1.0, (0.1, 0.7, 0.1)),
        ("MULTIPLY", 1.0, (0.08, 0.07, 0.01)),
        ("MULTIPLY", 0.5, (0.44, 0.08, 0.06)),
    ],
)
def test_mixed_colors(kind: str, blend: str, factor: float, expected: "tuple[float, ...]") -> None:
    made = makers.material()
    mix_colors(made, kind, factor, RED, GREEN, blend)
    assert color_of(made) == pytest.approx(expected, abs=0.011)
    assert not makers.notes()


def test_mix_of_numbers_as_a_color() -> None:
    made = makers.material()
    node = made.node_tree.nodes.new("ShaderNodeMix")
    node.data_type = "FLOAT"
    for socket, value in zip([one for one in node.inputs if one.enabled], (0.5, 0.2, 0.6)):
        socket.default_value = value
    made.node_tree.links.new(next(one for one in node.outputs if one.enabled), makers.principled(made).inputs["Base Color"])
    assert color_of(made) == pytest.approx((0.4, 0.4, 0.4), abs=0.011)


def test_number_of_a_color_is_its_luminance(camera: Any) -> None:
    made = makers.material()
    makers.principled(made).inputs["Metallic"].default_value = 1.0
    made.node_tree.links.new(value_node(made, (0.5, 0.5, 0.2, 1)).outputs[0], makers.principled(made).inputs["Roughness"])
    makers.principled(made).inputs["IOR"].default_value = 1.5
    tilted(made)
    rough = 0.2126 * 0.5 + 0.7152 * 0.5 + 0.0722 * 0.2
    keys = {"name": "Sample", **PLAIN, "metallic": 1, "roughness": rough}
    assert same(makers.cloud(COLUMNS), reference(camera, math.radians(20), ec.Material(keys)))


def test_nodes_that_are_passed_over_or_not_read_are_told() -> None:
    made = makers.material(Base_Color=GREEN)
    tree = made.node_tree
    bright = tree.nodes.new("ShaderNodeBrightContrast")
    tree.links.new(value_node(made, RED).outputs[0], bright.inputs["Color"])
    tree.links.new(bright.outputs[0], makers.principled(made).inputs["Base Color"])
    assert color_of(made) == RED[:3]
    assert "is passed over" in makers.notes()[0]
    tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs["Color"], makers.principled(made).inputs["Base Color"])
    assert color_of(made) == GREEN[:3]
    assert "is not read" in makers.notes()[0]


def test_mixes_of_mixes_are_read_once_each() -> None:
    """Forty nodes, of each of which both inputs come from the one before: two to the power of forty paths."""
    made = makers.material()
    nodes, links = nodes_of(made)
    before = shader(made, "ShaderNodeBsdfDiffuse", Color=GREEN)
    for _ in range(40):
        node = nodes.new("ShaderNodeMixShader")
        for index in (1, 2):
            links.new(before.outputs[0], node.inputs[index])
        before = node
    links.new(before.outputs[0], makers.output(made).inputs["Surface"])
    assert color_of(made) == pytest.approx(GREEN[:3], abs=0.011)


def test_nodes_in_a_circle_are_grey_and_told() -> None:
    made = makers.material()
    nodes, links = nodes_of(made)
    first, second = nodes.new("ShaderNodeMixShader"), nodes.new("ShaderNodeMixShader")
    links.new(first.outputs[0], second.inputs[1])
    links.new(second.outputs[0], first.inputs[1])
    links.new(second.outputs[0], makers.output(made).inputs["Surface"])
    assert color_of(made) == (0.8, 0.8, 0.8)
    assert len(makers.notes()) == 1


# --- images -----------------------------------------------------------------------------------------------------------


def checks(rows: int = 3, columns: int = 5, seed: int = 1) -> Any:
    """Colours of an image that is not symmetric, rows x columns x 3, 0 to 1."""
    return np.random.default_rng(seed).integers(40, 256, (rows, columns, 3)) / 255.0


def textured(made: Any, picture: Any, name: str = "Image Texture") -> Any:
    """An image node on the base colour, which shows texels as they are."""
    node = made.node_tree.nodes.new("ShaderNodeTexImage")
    node.image, node.interpolation, node.name = picture, "Closest", name
    made.node_tree.links.new(node.outputs["Color"], makers.principled(made).inputs["Base Color"])
    return node


def on_wall(seen: ec.PointCloud) -> "tuple[Any, Any, Any]":
    """u and v of the points on the wall before the camera, which is not turned, and their colours, 0 to 255."""
    place = seen.xyz + np.array(seen.origin)
    mask = place[:, 0] < 4
    colors = np.stack([seen[name] for name in ("red", "green", "blue")], axis=1)[mask]
    return 0.5 - place[mask, 1] / 2, 0.5 + place[mask, 2] / 2, colors


def assert_shows(
    seen: ec.PointCloud, colors: Any, place: "Callable[[Any, Any], tuple[Any, Any]]" = lambda u, v: (u, v), margin: float = 0.04
) -> None:
    """That the points have the colours of the texels (0 to 255) at the coordinates that `place` makes of theirs."""
    u, v, found = on_wall(seen)
    assert len(u) > 200
    rows, columns = colors.shape[:2]
    x, y = place(u, v)
    x, y = (x % 1) * columns, (1 - y % 1) * rows
    clear = (np.abs(x - np.rint(x)) > margin) & (np.abs(y - np.rint(y)) > margin)
    assert clear.sum() > 100
    texel = colors[np.clip(y.astype(int), 0, rows - 1), np.clip(x.astype(int), 0, columns - 1)]
    assert np.abs(texel - found)[clear].max() <= 1.01


def test_image_is_where_it_is_in_blender(camera: Any) -> None:
    made, picture = makers.material(), checks()
    textured(made, makers.image("Checks", picture))
    makers.wall("Wall", 2, (3, 0, 0), made)
    assert_shows(makers.cloud(COLUMNS), picture * 255)
    assert not makers.notes()


def test_image_multiplies_with_a_color(camera: Any) -> None:
    made, picture = makers.material(), checks()
    node = textured(made, makers.image("Checks", picture))
    mix_colors(made, "ShaderNodeMixRGB", 1.0, node.outputs["Color"], (0.5, 1.0, 0.25, 1), "MULTIPLY")
    makers.wall("Wall", 2, (3, 0, 0), made)
    light = np.where(picture <= 0.04045, picture / 12.92, ((picture + 0.055) / 1.055) ** 2.4)
    assert_shows(makers.cloud(COLUMNS), encoded(light * [0.5, 1.0, 0.25]))
    assert not makers.notes()


@pytest.mark.parametrize("through", ["uv_map", "attribute", "rendered", "texture_coordinate"])
def test_uv_maps_by_name_and_the_rendered_one(camera: Any, through: str) -> None:
    """The second UV map is turned by a quarter; the active one is not the one that is rendered."""
    made, picture = makers.material(), checks()
    node = textured(made, makers.image("Checks", picture))
    mesh = makers.wall("Wall", 2, (3, 0, 0), made).data
    makers.add_uvs(mesh, "Turned", [(0, 1), (0, 0), (1, 0), (1, 1)])
    mesh.uv_layers["UVMap"].active_render = True
    mesh.uv_layers.active = mesh.uv_layers["Turned"]
    turned = lambda u, v: (v, 1 - u)
    tree = made.node_tree
    if through == "uv_map":
        named = tree.nodes.new("ShaderNodeUVMap")
        named.uv_map = "Turned"
        tree.links.new(named.outputs[0], node.inputs["Vector"])
    elif through == "attribute":
        named = tree.nodes.new("ShaderNodeAttribute")
        named.attribute_name = "Turned"
        tree.links.new(named.outputs["Vector"], node.inputs["Vector"])
    elif through == "texture_coordinate":
        tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["UV"], node.inputs["Vector"])
    named_one = through in ("uv_map", "attribute")
    assert_shows(makers.cloud(COLUMNS), picture * 255, turned if named_one else lambda u, v: (u, v))
    mesh.uv_layers["Turned"].active_render = True
    mesh.update()
    assert_shows(makers.cloud(COLUMNS), picture * 255, turned)


def test_two_materials_with_uv_maps_of_their_own(camera: Any) -> None:
    first, second, picture = makers.material("First"), makers.material("Second"), checks()
    drawn = makers.image("Checks", picture)
    textured(first, drawn)
    node = textured(second, drawn)
    named = second.node_tree.nodes.new("ShaderNodeUVMap")
    named.uv_map = "Turned"
    second.node_tree.links.new(named.outputs[0], node.inputs["Vector"])
    corners = [(0, 1, -1), (0, 0, -1), (0, -1, -1), (0, 1, 1), (0, 0, 1), (0, -1, 1)]
    uvs = [(0, 0), (0.5, 0), (0.5, 1), (0, 1), (0.5, 0), (1, 0), (1, 1), (0.5, 1)]
    made = makers.thing("Wall", corners, [(0, 1, 4, 3), (1, 2, 5, 4)], first, second, uvs=uvs)
    made.location.x = 3
    makers.add_uvs(made.data, "Turned", [(v, 1 - u) for u, v in uvs])
    made.data.polygons[1].material_index = 1
    made.data.uv_layers["UVMap"].active_render = True
    assert_shows(makers.cloud(COLUMNS), picture * 255, lambda u, v: (np.where(u < 0.5, u, v), np.where(u < 0.5, v, 1 - u)))


def mapped(made: Any, node: Any, kind: str, location: Any, rotation: Any, scale: Any) -> Any:
    """A Mapping node before the coordinates of `node`, after the UV map."""
    mapping = made.node_tree.nodes.new("ShaderNodeMapping")
    mapping.vector_type = kind
    for name, value in (("Location", location), ("Rotation", rotation), ("Scale", scale)):
        if name in mapping.inputs and mapping.inputs[name].enabled:
            mapping.inputs[name].default_value = value
    made.node_tree.links.new(mapping.outputs[0], node.inputs["Vector"])
    made.node_tree.links.new(made.node_tree.nodes.new("ShaderNodeTexCoord").outputs["UV"], mapping.inputs["Vector"])
    return mapping


def blender_mapping(kind: str, location: Any, rotation: Any, scale: Any) -> "Callable[[Vector], Vector]":
    """What a Mapping node does, as the manual has it."""
    turn = Euler(rotation).to_matrix()

    def apply(place: Vector) -> Vector:
        if kind == "TEXTURE":
            back = turn.transposed() @ (place - Vector(location))
            return Vector([a / b if b else 0 for a, b in zip(back, scale)])
        turned = turn @ Vector([a * b for a, b in zip(place, scale)])
        return turned + Vector(location) if kind == "POINT" else turned

    return apply


def through(*steps: "Callable[[Vector], Vector]") -> "Callable[[Any, Any], tuple[Any, Any]]":
    def place(u: Any, v: Any) -> "tuple[Any, Any]":
        found = []
        for x, y in zip(u, v):
            point = Vector((x, y, 0))
            for step in steps:
                point = step(point)
            found.append(point)
        return np.array([one.x for one in found]), np.array([one.y for one in found])

    return place


@pytest.mark.parametrize("kind", ["POINT", "TEXTURE", "VECTOR"])
@pytest.mark.parametrize("rotation", [(0, 0, 0.4), (0.5, -0.3, 0.4)], ids=["about_z", "about_all"])
def test_mapping(camera: Any, kind: str, rotation: Any) -> None:
    made, picture = makers.material(), checks()
    node = textured(made, makers.image("Checks", picture))
    settings = (kind, (0.3, -0.2, 0.1), rotation, (1.5, 0.7, 1))
    mapped(made, node, *settings)
    makers.wall("Wall", 2, (3, 0, 0), made)
    assert_shows(makers.cloud(COLUMNS), picture * 255, through(blender_mapping(*settings)), margin=0.06)


def test_two_mappings_one_after_the_other(camera: Any) -> None:
    made, picture = makers.material(), checks()
    node = textured(made, makers.image("Checks", picture))
    last, first = ("POINT", (0.3, 0.1, 0), (0.2, 0, 0.5), (2, 1, 1)), ("TEXTURE", (0, 0.2, 0.3), (0.4, 0.1, -0.3), (1, 0.5, 2))
    mapped(made, mapped(made, node, *last), *first)
    makers.wall("Wall", 2, (3, 0, 0), made)
    assert_shows(makers.cloud(COLUMNS), picture * 255, through(blender_mapping(*first), blender_mapping(*last)), margin=0.08)


@pytest.mark.parametrize("scale", [(0, 1, 1), (1, 1, 0)])
def test_texture_mapping_without_size(camera: Any, scale: Any) -> None:
    made, picture = makers.material(), checks()
    node = textured(made, makers.image("Checks", picture))
    settings = ("TEXTURE", (-0.31, -0.27, 0), (0, 0, 0), scale)
    mapped(made, node, *settings)
    makers.wall("Wall", 2, (3, 0, 0), made)
    place = through(blender_mapping(*settings))
    # 0 is at the edge of a texel.
    inside = lambda u, v: tuple(np.where(x == 0, 1e-6, x) for x in place(u, v))
    assert_shows(makers.cloud(COLUMNS), picture * 255, inside, margin=0)


def mean_of(picture: Any) -> Any:
    """0 to 255, sRGB, the mean of the light."""
    return encoded(np.where(picture <= 0.04045, picture / 12.92, ((picture + 0.055) / 1.055) ** 2.4).mean(axis=(0, 1)))


@pytest.mark.parametrize("why", ["normal_mapping", "generated", "box", "constant"])
def test_mean_of_an_image_where_it_cannot_be_placed(camera: Any, why: str) -> None:
    made, picture = makers.material(), checks()
    node = textured(made, makers.image("Checks", picture))
    if why == "normal_mapping":
        mapped(made, node, "NORMAL", (0, 0, 0), (0, 0, 0), (2, 2, 2))
    elif why == "generated":
        coordinate = made.node_tree.nodes.new("ShaderNodeTexCoord")
        made.node_tree.links.new(coordinate.outputs["Generated"], node.inputs["Vector"])
    elif why == "constant":
        # What is not linked to a Mapping node is one place in the image.
        made.node_tree.links.new(made.node_tree.nodes.new("ShaderNodeMapping").outputs[0], node.inputs["Vector"])
    else:
        node.projection = "BOX"
    makers.wall("Wall", 2, (3, 0, 0), made)
    _, _, found = on_wall(makers.cloud(COLUMNS))
    assert np.abs(found - mean_of(picture)).max() <= 1.5
    assert "the mean of the image Checks is used" in makers.notes()[0]


def test_float_image_is_light(camera: Any) -> None:
    made, picture = makers.material(), checks()
    textured(made, makers.image("Checks", picture, float_buffer=True))
    makers.wall("Wall", 2, (3, 0, 0), made)
    assert_shows(makers.cloud(COLUMNS), encoded(picture))


def test_image_without_a_color_space_is_light(camera: Any) -> None:
    made, picture = makers.material(), checks()
    textured(made, makers.image("Checks", picture, is_data=True))
    makers.wall("Wall", 2, (3, 0, 0), made)
    assert_shows(makers.cloud(COLUMNS), encoded(picture))


def test_roughness_is_the_mean_of_its_map(camera: Any) -> None:
    made = makers.material(Metallic=1.0, IOR=1.5)
    picture = np.full((2, 2, 3), 0.2)
    picture[0] = 0.4
    node = made.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = makers.image("Rough", picture, is_data=True)
    made.node_tree.links.new(node.outputs["Color"], makers.principled(made).inputs["Roughness"])
    tilted(made)
    keys = {"name": "Sample", **PLAIN, "metallic": 1, "roughness": 0.3}
    assert same(makers.cloud(COLUMNS), reference(camera, math.radians(20), ec.Material(keys)))
    assert "the mean of the image Rough is used for Roughness" in makers.notes()[0]


@pytest.mark.parametrize("by", ["alpha", "color"])
def test_mask_cuts_out(camera: Any, by: str) -> None:
    """By the alpha of an image, or by the colours of another: three quarters are seen, one shows the backdrop."""
    made = makers.material(Base_Color=RED)
    solid = np.array([[1.0, 0.0], [1.0, 1.0]])
    picture = np.ones((2, 2, 4)) if by == "alpha" else np.repeat(solid[:, :, None], 3, axis=2)
    if by == "alpha":
        picture[:, :, 3] = solid
    node = made.node_tree.nodes.new("ShaderNodeTexImage")
    node.image, node.interpolation = makers.image("Mask", picture), "Closest"
    made.node_tree.links.new(node.outputs["Alpha" if by == "alpha" else "Color"], makers.principled(made).inputs["Alpha"])
    makers.wall("Wall", 2, (3, 0, 0), made)
    seen = makers.cloud(COLUMNS)
    direction = (seen.xyz + np.array(seen.origin)) / seen.range[:, None]
    y, z = direction[:, 1] / direction[:, 0] * 3, direction[:, 2] / direction[:, 0] * 3
    inside = (np.abs(y) < 0.95) & (np.abs(z) < 0.95) & (np.abs(y) > 0.05) & (np.abs(z) > 0.05)
    hole = (y < 0) & (z > 0)
    behind = (seen.xyz + np.array(seen.origin))[:, 0] > 5
    assert np.array_equal(behind[inside], hole[inside])


def test_alpha_of_a_mask_in_a_color_space_is_light(camera: Any) -> None:
    made = makers.material(Base_Color=RED)
    node = made.node_tree.nodes.new("ShaderNodeTexImage")
    # 188 of 255 is half of the light.
    node.image = makers.image("Mask", np.full((2, 2, 3), 188 / 255))
    made.node_tree.links.new(node.outputs["Color"], makers.principled(made).inputs["Alpha"])
    tilted(made)
    keys = {**PLAIN, "base_color": [0.8, 0.1, 0.1, 128 / 255], "name": "Sample"}
    expected = reference(camera, math.radians(20), ec.Material(keys, blend=True))
    assert abs((makers.cloud(COLUMNS).range > 5).mean() - (expected.range > 5).mean()) < 0.03


@pytest.mark.parametrize(("operation", "alpha"), [("GREATER_THAN", 1.0), ("ROUND", 1.0), ("MULTIPLY", 0.5)])
def test_mask_through_mathematics(camera: Any, operation: str, alpha: float) -> None:
    made = makers.material(Base_Color=RED)
    tree = made.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    picture = np.ones((2, 2, 4))
    picture[:, 0, 3] = 0
    node.image, node.interpolation = makers.image("Mask", picture), "Closest"
    between = tree.nodes.new("ShaderNodeMath")
    between.operation = operation
    between.inputs[1].default_value = 0.5
    tree.links.new(node.outputs["Alpha"], between.inputs[0])
    tree.links.new(between.outputs[0], makers.principled(made).inputs["Alpha"])
    makers.wall("Wall", 2, (3, 0, 0), made)
    seen = makers.cloud(COLUMNS)
    u, _, _ = on_wall(seen)
    assert (u > 0.45).all()
    assert len(u) == pytest.approx(alpha * 9.2 * 18.4, rel=0.15)


@pytest.mark.skipif(bpy.app.version >= (4, 2), reason="cut-outs are nodes")
@pytest.mark.parametrize(("alpha", "seen"), [(0.4, False), (0.6, True)])
def test_clipped_material(camera: Any, alpha: float, seen: bool) -> None:
    made = makers.material(Alpha=alpha)
    made.blend_method, made.alpha_threshold = "CLIP", 0.5
    makers.wall("Wall", 2, (3, 0, 0), made)
    u, _, _ = on_wall(makers.cloud(COLUMNS))
    assert len(u) == (324 if seen else 0)


def test_generated_image(camera: Any) -> None:
    made = makers.material()
    drawn = bpy.data.images.new("Drawn", 4, 4)
    drawn.generated_color = (0.5, 0.25, 0.75, 1)
    textured(made, drawn)
    makers.wall("Wall", 2, (3, 0, 0), made)
    _, _, found = on_wall(makers.cloud(COLUMNS))
    stored = np.array(drawn.pixels[:3]) * 255
    assert np.abs(found - stored).max() <= 1


def saved(picture: Any, path: Path) -> Any:
    made = makers.image("Saved", picture)
    made.filepath_raw, made.file_format = str(path), "PNG"
    made.save()
    bpy.data.images.remove(made)
    return bpy.data.images.load(str(path))


def test_packed_image_needs_no_file(camera: Any, tmp_path: Path) -> None:
    made, picture = makers.material(), checks()
    drawn = saved(picture, tmp_path / "checks.png")
    drawn.pack()
    (tmp_path / "checks.png").unlink()
    drawn.reload()
    textured(made, drawn)
    makers.wall("Wall", 2, (3, 0, 0), made)
    assert_shows(makers.cloud(COLUMNS), picture * 255)


@pytest.mark.parametrize("why", ["missing", "no_image", "too_large", "not_an_image"])
def test_image_that_cannot_be_read_is_white_and_told(camera: Any, tmp_path: Path, why: str) -> None:
    made = makers.material()
    if why == "missing":
        drawn = saved(checks(), tmp_path / "checks.png")
        (tmp_path / "checks.png").unlink()
        drawn.reload()
    elif why == "not_an_image":
        drawn = saved(checks(), tmp_path / "checks.png")
        (tmp_path / "checks.png").write_text("nothing")
        drawn.reload()
    else:
        drawn = None if why == "no_image" else bpy.data.images.new("Large", 16385, 1)
    textured(made, drawn)
    makers.wall("Wall", 2, (3, 0, 0), made)
    _, _, found = on_wall(makers.cloud(COLUMNS))
    assert (found == 255).all()
    (note,) = makers.notes()
    assert "white" in note


def test_image_on_a_mesh_without_a_uv_map(camera: Any) -> None:
    made = makers.material()
    textured(made, makers.image("Checks", checks()))
    wall = makers.wall("Wall", 2, (3, 0, 0), made)
    wall.data.uv_layers.remove(wall.data.uv_layers[0])
    makers.wall("Side", 1, (3, 5, 0), made).data.uv_layers.remove(bpy.data.objects["Side"].data.uv_layers[0])
    _, _, found = on_wall(makers.cloud(COLUMNS))
    assert (found == 255).all()
    (note,) = makers.notes()
    assert note.startswith("material Sample: the UV map of its image is missing in Wall and 1 more: it is white there")


def test_uv_map_of_a_name_that_a_mesh_does_not_have(camera: Any) -> None:
    made, picture = makers.material(), checks()
    named = made.node_tree.nodes.new("ShaderNodeUVMap")
    named.uv_map = "Other"
    made.node_tree.links.new(named.outputs[0], textured(made, makers.image("Checks", picture)).inputs["Vector"])
    makers.wall("Wall", 2, (3, 0, 0), made)
    assert_shows(makers.cloud(COLUMNS), picture * 255)
    (note,) = makers.notes()
    assert note.endswith("is missing in Wall: it is white there, or on the map that is rendered")


@pytest.mark.parametrize("interpolation", ["Closest", "Linear"])
def test_beyond_the_edges_of_an_image_that_is_clipped_there_is_nothing(camera: Any, interpolation: str) -> None:
    made, picture = makers.material(), checks()
    node = textured(made, makers.image("Checks", picture))
    node.extension, node.interpolation = "CLIP", interpolation
    made.node_tree.links.new(node.outputs["Alpha"], makers.principled(made).inputs["Alpha"])
    wall = makers.wall("Wall", 2, (3, 0, 0), made)
    # The image is in the middle, a third as wide and high.
    wall.data.uv_layers[0].data.foreach_set("uv", [-1, -1, 2, -1, 2, 2, -1, 2])
    margin = 1 / 6 if interpolation == "Closest" else 1 / 3
    u, v, _ = on_wall(makers.cloud(COLUMNS))
    assert len(u) > 20 and (np.abs(np.stack([u, v]) - 0.5) < margin).all()
    made.node_tree.links.remove(makers.principled(made).inputs["Alpha"].links[0])
    seen = makers.cloud(COLUMNS)
    u, v, found = on_wall(seen)
    outside = np.abs(np.stack([u, v]) - 0.5).max(axis=0) > margin
    assert outside.sum() > 100 and (found[outside] == 0).all()
    if interpolation == "Closest":
        assert_shows(seen, np.pad(picture * 255, ((3, 3), (5, 5), (0, 0))))


@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "MIRROR"])
def test_beyond_the_edges_of_an_image(camera: Any, extension: str) -> None:
    if extension == "MIRROR" and bpy.app.version < (3, 5):
        pytest.skip("Blender 3.4 has none")
    made, picture = makers.material(), checks()
    node = textured(made, makers.image("Checks", picture))
    node.extension = extension
    wall = makers.wall("Wall", 2, (3, 0, 0), made)
    wall.data.uv_layers[0].data.foreach_set("uv", [-0.5, -0.5, 2.5, -0.5, 2.5, 2.5, -0.5, 2.5])

    def place(u: Any, v: Any) -> "tuple[Any, Any]":
        def fold(x: Any) -> Any:
            x = 3 * x - 0.5
            if extension == "EXTEND":
                return np.clip(x, 1e-3, 1 - 1e-3)
            return x % 1 if extension == "REPEAT" else 1 - np.abs((x % 2) - 1)

        return fold(u), fold(v)

    assert_shows(makers.cloud(COLUMNS), picture * 255, place, margin=0.12 if extension != "EXTEND" else 0)


# --- custom properties ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("properties", "keys"),
    [
        ({"reflectance": 0.3}, {"reflectance": 0.3}),
        ({"reflectance": [{"wavelength_nm": 905.0, "value": 0.7}]}, {"reflectance": 0.7}),
        ({"blainder_rgba": [0.1, 0.2, 0.3, 0.4]}, {"reflectance": 0.4}),
        ({"blainder_rgba": [0.1, 0.2, 0.3, 0.4], "reflectance": 0.9}, {"reflectance": 0.9}),
        ({"scattering": {"model": "constant"}, "reflectance": 0.3}, {"reflectance": 0.3, "scattering": {"model": "constant"}}),
        ({"alpha": 0.5}, {}),
        ({"sound": "loud"}, {}),
        ({"radar": "strong"}, {}),
        ({"metallic": 1.0}, {"metallic": 1}),
        ({"blainder_metallic": 1, "blainder_ior": 1.7}, {"metallic": 1, "ior": 1.7}),
        ({"blainder_metallic": 0, "blainder_ior": 0.0}, {}),
    ],
    ids=lambda value: "-".join(value),
)
def test_custom_properties(camera: Any, properties: "dict[str, Any]", keys: "dict[str, Any]") -> None:
    made = makers.material(IOR=1.5)
    for name, value in properties.items():
        made[name] = value
    tilted(made)
    assert same(makers.cloud(COLUMNS), reference(camera, math.radians(20), ec.Material({"name": "Sample", **PLAIN, **keys})))
    assert not makers.notes()


def test_thickness_of_a_pane(camera: Any) -> None:
    made = makers.material(IOR=1.5, Roughness=0.0, **{TRANSMISSION.replace(" ", "_"): 1.0})
    made["pane_m"] = 0.05
    tilted(made)
    keys = {"name": "Sample", **PLAIN, "roughness": 0, "transmission": 1, "pane_m": 0.05}
    assert same(makers.cloud(COLUMNS), reference(camera, math.radians(20), ec.Material(keys)))


@pytest.mark.parametrize(
    "properties",
    [
        {"reflectance": 7.0},
        {"reflectance": "bright"},
        {"scattering": "rough"},
        {"scattering": {"model": "velvet"}},
        {"pane_m": -1.0},
        {"ior": 0.0},
        {"blainder_rgba": 0.5},
        {"blainder_rgba": "abcd"},
        {"blainder_rgba": [0.1, 0.2]},
        {"alpha": "glass"},
        {"metallic": [1.0, 2.0]},
        {"dirt": None},
    ],
    ids=json.dumps,
)
def test_wrong_custom_properties_are_told_and_not_used(camera: Any, properties: "dict[str, Any]") -> None:
    made = makers.material(IOR=1.5)
    for name, value in properties.items():
        made[name] = bpy.data.objects["Sensor"] if value is None else value
    tilted(made)
    assert same(makers.cloud(COLUMNS), reference(camera, math.radians(20), ec.Material({"name": "Sample", **PLAIN})))
    (note,) = makers.notes()
    assert note.startswith("material Sample: ") and next(iter(properties)) in note


def test_no_number_in_a_socket(camera: Any) -> None:
    made = makers.material()
    made.node_tree.links.new(value_node(made, (math.nan, math.inf, -1, 1)).outputs[0], makers.principled(made).inputs["Base Color"])
    node = made.node_tree.nodes.new("ShaderNodeValue")
    node.outputs[0].default_value = math.nan
    for name in ("Metallic", "Roughness", "IOR", "Alpha", TRANSMISSION):
        made.node_tree.links.new(node.outputs[0], makers.principled(made).inputs[name])
    tilted(made)
    assert len(makers.cloud(COLUMNS))


# --- slots ------------------------------------------------------------------------------------------------------------


def three(*materials: Any) -> Any:
    """Three walls in one mesh, side by side from left to right."""
    corners = [(0, y, z) for z in (-1, 1) for y in (1.5, 0.5, -0.5, -1.5)]
    faces = [(index, index + 1, index + 5, index + 4) for index in range(3)]
    made = makers.thing("Wall", corners, faces, *materials)
    made.location.x = 3
    for index, face in enumerate(made.data.polygons):
        face.material_index = index
    return made


def seen_materials(seen: ec.PointCloud) -> "list[str]":
    """Names of the materials from left to right, each once."""
    place = seen.xyz + np.array(seen.origin)
    mask = place[:, 0] < 4
    order = np.argsort(-place[mask, 1], kind="stable")
    names = [seen.materials.get(int(number), "") for number in seen["material_id"][mask][order]]
    return [name for index, name in enumerate(names) if index == 0 or name != names[index - 1]]


def test_empty_slot_and_index_beyond_the_slots(camera: Any) -> None:
    # Blender uses the last slot for indices beyond.
    three(makers.material("First"), None)
    assert seen_materials(makers.cloud(COLUMNS)) == ["First", "no material"]
    bpy.data.objects["Wall"].data.materials.append(makers.material("Third"))
    assert seen_materials(makers.cloud(COLUMNS)) == ["First", "no material", "Third"]


def test_index_of_an_object_with_one_slot(camera: Any) -> None:
    three(makers.material("Only"))
    assert seen_materials(makers.cloud(COLUMNS)) == ["Only"]


def test_slots_of_the_object(camera: Any) -> None:
    made = three(makers.material("First"), makers.material("Second"), makers.material("Third"))
    slot = made.material_slots[1]
    slot.link = "OBJECT"
    slot.material = makers.material("Own")
    assert seen_materials(makers.cloud(COLUMNS)) == ["First", "Own", "Third"]


def test_one_mesh_with_materials_of_two_objects(camera: Any) -> None:
    left = makers.wall("Left", 1, (3, 0.6, 0), makers.material("Shared"))
    right = bpy.data.objects.new("Right", left.data)
    bpy.context.scene.collection.objects.link(right)
    right.location = (3, -0.6, 0)
    assert seen_materials(makers.cloud(COLUMNS)) == ["Shared"]
    for thing in (left, right):
        thing.material_slots[0].link = "OBJECT"
        thing.material_slots[0].material = makers.material(f"Of {thing.name}")
    assert seen_materials(makers.cloud(COLUMNS)) == ["Of Left", "Of Right"]
    right.material_slots[0].link = "DATA"
    assert seen_materials(makers.cloud(COLUMNS)) == ["Of Left", "Shared"]


def test_slots_of_a_text(camera: Any) -> None:
    curve = bpy.data.curves.new("Text", "FONT")
    curve.body = "W"
    curve.materials.append(makers.material("Shared"))
    made = bpy.data.objects.new("Text", curve)
    bpy.context.scene.collection.objects.link(made)
    made.location, made.rotation_euler, made.scale = (3, 1, -1), (math.pi / 2, 0, -math.pi / 2), (2, 2, 2)
    assert seen_materials(makers.cloud(COLUMNS)) == ["Shared"]
    made.material_slots[0].link = "OBJECT"
    made.material_slots[0].material = makers.material("Own")
    assert seen_materials(makers.cloud(COLUMNS)) == ["Own"]


def test_a_changed_material_is_read_again(camera: Any) -> None:
    made = makers.material(Base_Color=RED)
    tilted(made)
    before = makers.cloud(COLUMNS)
    makers.principled(made).inputs["Base Color"].default_value = GREEN
    after = makers.cloud(COLUMNS)
    seen = [one[one.range < 4] for one in (before, after)]
    assert (seen[0]["red"] > seen[0]["green"]).all() and (seen[1]["red"] < seen[1]["green"]).all()


def test_a_material_in_the_place_of_another(camera: Any) -> None:
    """One that is made after another was removed may be where that was in memory."""
    wall = tilted(makers.material("First", Base_Color=RED))
    for index in range(4):
        color = (GREEN, RED)[index % 2]
        bpy.data.materials.remove(wall.data.materials[0])
        wall.data.materials.clear()
        wall.data.materials.append(makers.material(f"Next{index}", Base_Color=color))
        seen = makers.cloud(COLUMNS)
        seen = seen[seen.range < 4]
        assert (seen["green"] > seen["red"]).all() == (color == GREEN)
        assert seen.materials[int(seen["material_id"][0])] == f"Next{index}"
        makers.cloud(COLUMNS)
