"""The same scene from Blender and through glTF."""

from pathlib import Path
from typing import Any

import bpy
import echocast as ec
import makers
import numpy as np
import pytest
from echocast_blender import scene

CAMERA = {
    "name": "camera",
    "kind": "tof",
    "pattern": {"type": "pinhole", "resolution": [160, 120], "fov_deg": [80, 64]},
    "beam": {"wavelength_nm": 905},
}


def build() -> None:
    """Everything that glTF can say."""
    red = makers.material("red paint", Base_Color=(0.8, 0.05, 0.05, 1))
    steel = makers.material("steel", Base_Color=(0.6, 0.6, 0.6, 1), Metallic=0.8, Roughness=0.4)
    brick = makers.material("brick", Base_Color=(0.4, 0.2, 0.1, 1))
    bpy.ops.mesh.primitive_plane_add(size=30, location=(8, 0, -1))
    bpy.context.object.name = "Ground"
    bpy.context.object.data.materials.append(brick)
    bpy.ops.mesh.primitive_cube_add(location=(6, -2, 0), rotation=(0.1, 0.2, 0.7))
    cube = bpy.context.object
    cube.data.materials.append(red)
    cube.data.materials.append(steel)
    for index, face in enumerate(cube.data.polygons):
        face.material_index = index % 2
    copy = bpy.data.objects.new("Cube.001", cube.data)
    bpy.context.collection.objects.link(copy)
    copy.location, copy.scale = (8, 2, 0.5), (1, 0.5, 2)
    bpy.ops.mesh.primitive_uv_sphere_add(location=(5, 1, 0), segments=24, ring_count=12)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(steel)
    bpy.context.object["categoryID"] = 12
    image = bpy.data.images.new("squares", 8, 4)
    image.pixels = [value for row in range(4) for column in range(8) for value in (row / 3, column / 7, 0.2, 1)]
    image.pack()
    textured = makers.material("poster")
    node = textured.node_tree.nodes.new("ShaderNodeTexImage")
    node.image, node.interpolation = image, "Closest"
    textured.node_tree.links.new(node.outputs["Color"], makers.principled(textured).inputs["Base Color"])
    bpy.ops.mesh.primitive_plane_add(size=4, location=(12, 0, 1.5), rotation=(1.5707963, 0, 1.5707963))
    bpy.context.object.data.materials.append(textured)
    bpy.context.object.name = "Poster"


def through_gltf(folder: Path) -> ec.Scene:
    file = folder / "scene.glb"
    bpy.ops.export_scene.gltf(filepath=str(file), export_format="GLB", export_extras=True)
    return ec.Scene.load(file)


def test_both_ways_give_the_same_scan(tmp_path: Path) -> None:
    build()
    exported = scene.exported(bpy.context)
    options: Any = {"at": (0, 0, 0.5), "organised": True, "fields": "default,cos_incidence,normal_x,material_id"}
    ours, theirs = exported.live.scan(CAMERA, **options), through_gltf(tmp_path).scan(CAMERA, **options)
    hit = np.isfinite(theirs.range)
    assert hit.sum() > 10_000
    along_edges = hit != np.isfinite(ours.range)
    assert along_edges.sum() <= 3
    both = hit & np.isfinite(ours.range)
    near = np.abs(ours.range - theirs.range) < 1e-4
    assert (both & ~near).sum() <= 3
    same = both & near

    def named(cloud: ec.PointCloud, column: str, table: "dict[int, str]") -> Any:
        return np.array([table.get(number, "") for number in cloud[column]])

    for column, table in (("category_id", "categories"), ("material_id", "materials"), ("instance_id", "instances")):
        differ = named(ours, column, getattr(ours, table))[same] != named(theirs, column, getattr(theirs, table))[same]
        assert differ.sum() <= 3, column
    for column, tolerance in (("red", 1), ("green", 1), ("blue", 1), ("cos_incidence", 2e-3), ("intensity", 1e-3)):
        a, b = ours[column][same].astype(float), theirs[column][same].astype(float)
        scale = 1.0 if column != "intensity" else np.maximum(b, 1e-9)
        # Normals are rounded by the exporter, and pixels along edges of the image.
        assert (np.abs(a - b) / scale > tolerance).mean() < 2e-3, column


@pytest.mark.skipif(bpy.app.version < (4, 2), reason="Blender 3.4 has no glTF transmission that is comparable")
def test_panes_are_panes_both_ways(tmp_path: Path) -> None:
    build()
    pane = makers.material("Window glass", Transmission_Weight=1.0, Roughness=0.0)
    bpy.ops.mesh.primitive_plane_add(size=3, location=(2, 0, 0.5), rotation=(0, 1.5707963, 0))
    bpy.context.object.data.materials.append(pane)
    exported = scene.exported(bpy.context)
    options: Any = {"at": (0, 0, 0.5), "organised": True, "fields": "default,bounces"}
    ours, theirs = exported.live.scan(CAMERA, **options), through_gltf(tmp_path).scan(CAMERA, **options)
    both = np.isfinite(ours.range) & np.isfinite(theirs.range)
    assert both.sum() > 10_000 and (np.abs(ours.range - theirs.range)[both] > 1e-4).mean() < 1e-3
