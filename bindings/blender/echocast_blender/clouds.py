"""Results of scans in Blender: point clouds with their columns as attributes, and images."""

import colorsys
import json
from typing import Any

import bpy
import numpy as np

from . import geometry, srgb
from .scan import Result
from .scene import RESULT, made_by

COLLECTION = "Echocast"
MATERIAL = "Echocast points"
COLOR = "echocast_color"
#: Properties of images: what they show, and the numbers that are black and white.
TITLE, RANGE = "echocast_image", "echocast_range"

#: Columns whose numbers are names: each number has a colour.
LABELS = ("category_id", "part_id", "instance_id", "material_id", "first_category_id", "first_instance_id", "cause", "track_id")

#: Columns that are the positions of vertices.
PLACE = ("x", "y", "z")
#: Types of attributes that columns have, and those of their numbers.
KINDS = {"INT": np.int32, "FLOAT": np.float32}

#: Positions in a table of colours from blue over green to red, and red, green, blue there, linear.
SCALE = np.array(
    [
        [0.00, 0.015, 0.010, 0.100],
        [0.25, 0.010, 0.170, 0.620],
        [0.50, 0.040, 0.600, 0.220],
        [0.75, 0.850, 0.620, 0.030],
        [1.00, 0.700, 0.030, 0.010],
    ]
)


def add(context: Any, result: Result, scale: float) -> Any:
    """Adds the object of a cloud, or fills the one of this sensor and frame. `scale`: metres per unit."""
    wanted, cloud = context.scene.echocast, result.cloud
    name = f"{result.task.name} {result.task.frame}"
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(cloud))
    geometry.set_vertices(mesh, np.ascontiguousarray(cloud.xyz / scale, dtype=np.float32))
    for field in cloud.fields:
        if field not in PLACE:
            set_attribute(mesh, field, cloud[field])
    paint(mesh, wanted.color)
    thing = existing(context.scene, result)
    if thing is None:
        thing = bpy.data.objects.new(name, mesh)
        collection(context.scene).objects.link(thing)
        thing.hide_render = True
    else:
        old, thing.data = thing.data, mesh
        if old.users == 0:
            bpy.data.meshes.remove(old)
    thing.location = [place / scale for place in cloud.origin]
    thing[RESULT] = json.dumps({"sensor": result.task.name, "frame": result.task.frame, "color": wanted.color})
    for table in ("categories", "parts", "instances", "materials"):
        thing[table] = {str(number): name for number, name in getattr(cloud, table).items()}
    show_points(thing, wanted.radius)
    return thing


def existing(scene: Any, result: Result) -> Any:
    for thing in scene.objects:
        if thing.type == "MESH":
            found = made_by(thing)
            if (found.get("sensor"), found.get("frame")) == (result.task.name, result.task.frame):
                return thing
    return None


def collection(scene: Any) -> Any:
    """The collection of results of a scene."""
    found = next((one for one in scene.collection.children if one.name.split(".")[0] == COLLECTION), None)
    if found is None:
        found = bpy.data.collections.new(COLLECTION)
        scene.collection.children.link(found)
    return found


def set_attribute(mesh: Any, name: str, values: Any) -> None:
    if values.dtype.kind in "iu":
        kind, values = "INT", np.minimum(values.astype(np.int64), 2**31 - 1).astype(np.int32)
    else:
        # Single precision is fine for times only if they count from the start.
        start = values.min() if name == "time" and len(values) else 0.0
        kind, values = "FLOAT", (values - start).astype(np.float32)
    attribute = mesh.attributes.new(name, kind, "POINT")
    if len(values):
        attribute.data.foreach_set("value", np.ascontiguousarray(values))


def column(mesh: Any, name: str) -> Any:
    """A column of the points; None: they do not have it."""
    attribute = mesh.attributes.get(name)
    if attribute is None or attribute.domain != "POINT" or attribute.data_type not in KINDS:
        return None
    return geometry.get(attribute.data, "value", len(attribute.data), KINDS[attribute.data_type])


def paint(mesh: Any, name: str) -> None:
    """Colours points by a column."""
    values = colors(mesh, name)
    before = mesh.attributes.get(COLOR)
    if before is not None:
        mesh.attributes.remove(before)
    mesh.attributes.new(COLOR, "FLOAT_COLOR", "POINT").data.foreach_set("color", values.ravel())
    mesh.update()


def paint_again(scene: Any) -> None:
    """Colours the points that a scene has by the column that it wants now."""
    for thing in scene.objects:
        # What is linked from other files stays as it is, and in edit mode attributes are not in the mesh.
        if thing.type != "MESH" or thing.library or thing.data.library or thing.data.is_editmode:
            continue
        made = made_by(thing)
        if made:
            thing[RESULT] = json.dumps({**made, "color": scene.echocast.color})
            paint(thing.data, scene.echocast.color)


def colors(mesh: Any, name: str) -> Any:
    """Red, green, blue, alpha of each point, linear, float32."""
    count = len(mesh.vertices)
    if name == "color":
        channels = [column(mesh, channel) for channel in ("red", "green", "blue")]
        if all(channel is not None for channel in channels):
            light = srgb.light(np.stack(channels, axis=1) / 255.0)
            return np.concatenate([light, np.ones((count, 1))], axis=1).astype(np.float32)
    values = geometry.vertices(mesh)[:, PLACE.index(name)] if name in PLACE else column(mesh, name)
    if values is None:
        return np.tile(np.array([0.8, 0.8, 0.8, 1.0], dtype=np.float32), (count, 1))
    if name in LABELS:
        numbers, place = np.unique(values, return_inverse=True)
        table = np.array([label_color(int(number)) for number in numbers], dtype=np.float32).reshape(-1, 4)
        return table[place.ravel()]
    values = values.astype(np.float64)
    known = values[np.isfinite(values)]
    # One outlier would leave the rest in one colour.
    low, high = np.percentile(known, [1, 99]) if len(known) else (0.0, 1.0)
    part = np.clip((np.nan_to_num(values, nan=low) - low) / (high - low if high > low else 1.0), 0, 1)
    channels = [np.interp(part, SCALE[:, 0], SCALE[:, channel]) for channel in (1, 2, 3)]
    return np.stack([*channels, np.ones(count)], axis=1).astype(np.float32)


def label_color(number: int) -> "tuple[float, float, float, float]":
    """A colour for a label, linear: grey for none, else steps of the golden ratio around the circle of hues."""
    if number == 0:
        return (0.3, 0.3, 0.3, 1.0)
    hue = number * 0.6180339887498949 % 1.0
    # Hues and saturations are of colours as they are shown.
    red, green, blue = srgb.light(np.array(colorsys.hsv_to_rgb(hue, 0.75 if number % 2 else 0.55, 0.8))).tolist()
    return (red, green, blue, 1.0)


# --- how points look ----------------------------------------------------------------------------------------------


def material() -> Any:
    """A material that shows the colours of points."""
    found = bpy.data.materials.get(MATERIAL)
    if found is not None:
        return found
    made = bpy.data.materials.new(MATERIAL)
    if bpy.app.version < (5, 0):
        made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    attribute = tree.nodes.new("ShaderNodeAttribute")
    attribute.attribute_name = COLOR
    shader = tree.nodes.new("ShaderNodeEmission")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    attribute.location, shader.location = (-400, 0), (-200, 0)
    tree.links.new(attribute.outputs["Color"], shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return made


def show_points(thing: Any, radius: float) -> None:
    """Vertices are not rendered: nodes make points of them, with the material."""
    modifier = thing.modifiers.get(COLLECTION) or thing.modifiers.new(COLLECTION, "NODES")
    modifier.node_group = point_nodes(radius)
    # In the viewport the overlay draws them.
    modifier.show_viewport = False


def geometry_tree(name: str) -> "tuple[Any, Any, Any]":
    """A new node tree from geometry to geometry, with the nodes of its input and output."""
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    if hasattr(tree, "interface"):
        for way in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    else:
        tree.inputs.new("NodeSocketGeometry", "Geometry")
        tree.outputs.new("NodeSocketGeometry", "Geometry")
    return tree, tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")


def point_nodes(radius: float) -> Any:
    name = f"{COLLECTION} points {radius:.4g}"
    found = bpy.data.node_groups.get(name)
    if found is not None:
        return found
    tree, start, end = geometry_tree(name)
    nodes = tree.nodes
    paint = nodes.new("GeometryNodeSetMaterial")
    paint.inputs["Material"].default_value = material()
    points = nodes.new("GeometryNodeMeshToPoints")
    points.inputs["Radius"].default_value = radius
    tree.links.new(start.outputs[0], points.inputs["Mesh"])
    tree.links.new(points.outputs[0], paint.inputs["Geometry"])
    tree.links.new(paint.outputs[0], end.inputs[0])
    for index, node in enumerate((start, points, paint, end)):
        node.location = (200 * index, 0)
    return tree


# --- images -------------------------------------------------------------------------------------------------------


def add_images(result: Result) -> "list[Any]":
    """Adds what a camera or a sonar shows as images of Blender; returns them."""
    title = f"{result.task.name} {result.task.frame}"
    made = []
    if result.ping is not None:
        levels = result.ping.fan().values if result.ping.view in ("fan", "swath") else result.ping.levels
        made.append(set_image(f"{title} levels", np.atleast_2d(levels)))
    elif result.task.sensor.kind == "tof":
        for layer in ("depth", "category"):
            values = result.cloud.image(layer, result.task.sensor)
            made.append(set_image(f"{title} {layer}", np.asarray(values, dtype=np.float32)))
    return made


def set_image(name: str, values: Any) -> Any:
    """A grey image of float32, the lowest value black, the highest white; its numbers are in its property RANGE."""
    height, width = values.shape[:2]
    # One of that name may be somebody else's.
    image = next((one for one in bpy.data.images if one.get(TITLE) == name), None)
    if image is not None and tuple(image.size) != (width, height):
        bpy.data.images.remove(image)
        image = None
    if image is None:
        image = bpy.data.images.new(name, width, height, alpha=False, float_buffer=True)
        # Otherwise it is not saved, as nothing uses it.
        image.use_fake_user = True
        image[TITLE] = name
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    grey = np.nan_to_num((values - low) / (high - low if high > low else 1.0), nan=0.0, posinf=1.0, neginf=0.0)
    pixels = np.ones((height, width, 4), dtype=np.float32)
    pixels[:, :, :3] = grey[::-1, :, None]
    image.pixels.foreach_set(pixels.ravel())
    image[RANGE] = [low, high]
    image.pack()
    return image
