"""Small scenes, sensors and scans for tests."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import bpy
import echocast as ec
import numpy as np
from echocast_blender import scan

#: A small depth camera without errors, whose intensities are reflectances.
CAMERA_KEYS: "dict[str, Any]" = {
    "name": "camera",
    "kind": "tof",
    "pattern": {"type": "pinhole", "resolution": [32, 24], "fov_deg": [60, 46.8], "rate_hz": 30},
    "beam": {"wavelength_nm": 905},
    "intensity": {"encoding": "reflectivity"},
}


def thing(name: str, vertices: Any, faces: Any, *materials: Any, uvs: Any = None) -> Any:
    """A mesh object in the scene; `uvs` of corners, in the order of the faces."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(vertex) for vertex in vertices], [], [tuple(face) for face in faces])
    for one in materials:
        mesh.materials.append(one)
    if uvs is not None:
        add_uvs(mesh, "UVMap", uvs)
    mesh.update()
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def add_uvs(mesh: Any, name: str, uvs: Any) -> None:
    mesh.uv_layers.new(name=name).data.foreach_set("uv", np.asarray(uvs, dtype=np.float32).ravel())


def plane(name: str = "Plane", size: float = 2.0, location: "Sequence[float]" = (0, 0, 0), *materials: Any) -> Any:
    """A square that faces up, with u along x and v along y."""
    half = size / 2
    corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
    made = thing(name, corners, [(0, 1, 2, 3)], *materials, uvs=[(0, 0), (1, 0), (1, 1), (0, 1)])
    made.location = location
    return made


def wall(name: str = "Wall", size: float = 2.0, location: "Sequence[float]" = (3, 0, 0), *materials: Any) -> Any:
    """A square that faces against x, as a sensor sees it: u to the right, v up."""
    half = size / 2
    corners = [(0, half, -half), (0, -half, -half), (0, -half, half), (0, half, half)]
    made = thing(name, corners, [(0, 1, 2, 3)], *materials, uvs=[(0, 0), (1, 0), (1, 1), (0, 1)])
    made.location = location
    return made


def cube(name: str = "Cube", size: float = 2.0, location: "Sequence[float]" = (0, 0, 0), *materials: Any) -> Any:
    half = size / 2
    corners = [(x, y, z) for x in (-half, half) for y in (-half, half) for z in (-half, half)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    made = thing(name, corners, faces, *materials)
    made.location = location
    return made


def empty(name: str = "Empty", location: "Sequence[float]" = (0, 0, 0), parent: Any = None) -> Any:
    made = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(made)
    made.location, made.parent = location, parent
    return made


def collection(name: str, *members: Any) -> Any:
    """A collection of objects that are not in the scene itself."""
    made = bpy.data.collections.new(name)
    for one in members:
        for holder in one.users_collection:
            holder.objects.unlink(one)
        made.objects.link(one)
    return made


def material(name: str = "Sample", **inputs: Any) -> Any:
    """A material with nodes, a Principled BSDF with `inputs`: Base_Color=(1, 0, 0, 1)."""
    made = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        made.use_nodes = True
    for key, value in inputs.items():
        principled(made).inputs[key.replace("_", " ")].default_value = value
    return made


def principled(of: Any) -> Any:
    return next(node for node in of.node_tree.nodes if node.type == "BSDF_PRINCIPLED")


def output(of: Any) -> Any:
    return of.node_tree.get_output_node("ALL")


def image(name: str, pixels: Any, **settings: Any) -> Any:
    """An image of height x width x 3 or 4 numbers, from the top row down, as stored."""
    values = np.asarray(pixels, dtype=np.float32)
    if values.shape[2] == 3:
        values = np.concatenate([values, np.ones((*values.shape[:2], 1), dtype=np.float32)], axis=2)
    made = bpy.data.images.new(name, values.shape[1], values.shape[0], alpha=True, **settings)
    made.pixels.foreach_set(values[::-1].ravel())
    made.update()
    return made


def write_sensor(path: Path, **changes: Any) -> str:
    """Writes a sensor file, a small camera without errors with `changes`; returns its path."""
    path.write_text(json.dumps({**CAMERA_KEYS, **changes}))
    return str(path)


def sensor(preset: str = "", name: str = "Sensor", location: "Sequence[float]" = (0, 0, 0), kind: str = "EMPTY") -> Any:
    """A sensor in the scene. An empty looks along x, a camera along -z, as all cameras of Blender do."""
    made = bpy.data.objects.new(name, bpy.data.cameras.new(name) if kind == "CAMERA" else None)
    bpy.context.scene.collection.objects.link(made)
    made.location = location
    made.echocast.is_sensor = True
    made.echocast.preset = preset
    return made


def parameter(of: Any, path: str) -> Any:
    return next(one for one in of.echocast.parameters if one.name == path)


def scans(columns: "str | None" = None, going: "Callable[[float], bool]" = lambda fraction: True) -> "list[scan.Result]":
    """The results of all sensors at this frame, without adding them to the scene."""
    if columns is not None:
        bpy.context.scene.echocast.columns = columns
    wanted = bpy.context.scene
    return list(scan.run(scan.prepare(bpy.context, wanted.frame_current), going, wanted.echocast.images))


def cloud(columns: "str | None" = None) -> ec.PointCloud:
    """The cloud of the only sensor."""
    (result,) = scans(columns)
    return result.cloud


def notes() -> "list[str]":
    """What reading the scene reports."""
    return scan.prepare(bpy.context, bpy.context.scene.frame_current).notes


#: Properties that are evaluated, or of this session, or that Blender is about to remove.
PASSING = ("rna_type", "original", "session_uid", "is_evaluated", "is_updated", "is_updated_data", "tag", "preview", "asset_data")
PASSING += ("use_nodes", "depsgraph")
#: Parts of data-blocks that are looked into.
PARTS = ("nodes", "links", "inputs", "modifiers", "constraints", "material_slots", "view_layers", "parameters", "outputs", "layers")
GROUPS = ("render", "unit_settings", "echocast")


def fingerprint() -> "dict[str, Any]":
    """All data-blocks of the file but windows: their properties by paths, and the vertices of meshes."""
    bpy.context.view_layer.update()
    found: "dict[str, Any]" = {}
    for kind in (prop.identifier for prop in bpy.data.bl_rna.properties if prop.type == "COLLECTION"):
        for one in getattr(bpy.data, kind) if kind not in ("window_managers", "workspaces", "screens") else ():
            path = f"{kind}/{one.name_full}"
            add_properties(one, path, found)
            found.update({f"{path}[{key}]": repr(one[key]) for key in one.keys()})
            if isinstance(one, bpy.types.Mesh):
                places = np.empty(3 * len(one.vertices), dtype=np.float32)
                one.vertices.foreach_get("co", places)
                found[f"{path}/co"] = places.tobytes()
    return found


def add_properties(of: Any, path: str, found: "dict[str, Any]") -> None:
    for prop in of.bl_rna.properties:
        name = prop.identifier
        if name in PASSING:
            continue
        value = getattr(of, name)
        if prop.type == "COLLECTION":
            found[f"{path}/{name}"] = len(value)
            if name in PARTS:
                for index, one in enumerate(value):
                    add_properties(one, f"{path}/{name}[{index}]", found)
        elif isinstance(value, bpy.types.ID):
            found[f"{path}/{name}"] = value.name_full
            # Node trees of materials belong to them.
            if name == "node_tree":
                add_properties(value, f"{path}/{name}", found)
        elif prop.type == "POINTER":
            found[f"{path}/{name}"] = value is not None
            if name in GROUPS:
                add_properties(value, f"{path}/{name}", found)
        else:
            found[f"{path}/{name}"] = repr(value[:] if getattr(prop, "is_array", False) and len(value) < 1000 else value)


def differences(before: "dict[str, Any]") -> "list[str]":
    """What has changed in the file since that fingerprint."""
    after = fingerprint()
    paths = [path for path in {**before, **after} if before.get(path) != after.get(path)]
    return [f"{path}: {str(before.get(path))[:80]} -> {str(after.get(path))[:80]}" for path in paths]
