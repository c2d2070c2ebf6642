"""What is scanned is what Blender renders: each beam against Blender's own rays, where these can say it."""

import math
from typing import Any

import bpy
import echocast as ec
import makers
import numpy as np
import pytest
from echocast_blender import clouds, evaluated, scene
from makers import material
from mathutils import Vector

#: As many beams in all directions (Fibonacci's sphere).
BEAMS = 4000


def directions() -> Any:
    index = np.arange(BEAMS) + 0.5
    z = 1 - 2 * index / BEAMS
    angle = index * math.pi * (3 - math.sqrt(5))
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


def sphere_sensor(tmp_path: Any) -> ec.Sensor:
    """One ideal ray in each of the directions."""
    file = tmp_path / "rays.csv"
    rays = directions()
    azimuth, elevation = np.degrees(np.arctan2(rays[:, 1], rays[:, 0])), np.degrees(np.arcsin(rays[:, 2]))
    lines = [f"{a!r},{e!r}" for a, e in zip(azimuth.tolist(), elevation.tolist())]
    file.write_text("azimuth_deg,elevation_deg\n" + "\n".join(lines))
    return ec.Sensor({"name": "sphere", "kind": "lidar", "pattern": {"type": "table", "file": str(file), "rate_hz": 10}})


def ranges(exported: scene.ExportedScene, sensor: ec.Sensor, at: Any) -> Any:
    """Range of each beam, inf where there is none."""
    cloud = exported.live.scan(sensor, at=at, fields="range,beam", specular_depth=0)
    found = np.full(BEAMS, np.inf)
    found[cloud.beam] = cloud.range
    return found


def blender_ranges(at: Any) -> Any:
    """The same by Blender, in its viewport."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    found = np.full(BEAMS, np.inf)
    for index, direction in enumerate(directions()):
        hit, place, *_ = bpy.context.scene.ray_cast(depsgraph, Vector(at), Vector(direction))
        if hit:
            found[index] = (place - Vector(at)).length
    return found


def compare(tmp_path: Any, at: Any = (0.0, 0.0, 0.3), hits: int = 100) -> scene.ExportedScene:
    """Checks that all beams but those along edges have the same range."""
    exported = scene.exported(bpy.context)
    ours, theirs = ranges(exported, sphere_sensor(tmp_path), at), blender_ranges(at)
    assert np.isfinite(theirs).sum() >= hits
    both = np.isfinite(ours) & np.isfinite(theirs)
    # Along an edge rounding decides.
    assert (np.isfinite(ours) != np.isfinite(theirs)).sum() <= 4
    differ = np.abs(ours[both] - theirs[both]) > 1e-4 * np.maximum(1, theirs[both] / 10)
    assert differ.sum() <= 4, f"{differ.sum()} of {both.sum()} beams"
    return exported


def names(exported: scene.ExportedScene) -> "list[str]":
    return sorted(exported.live.objects.values())


def test_meshes_with_modifiers(tmp_path: Any) -> None:
    bpy.ops.mesh.primitive_monkey_add(location=(3, 0, 0), rotation=(0.3, 0.2, -1), scale=(1.5, 1, 0.7))
    bpy.context.object.modifiers.new("smooth", "SUBSURF").levels = 2
    bpy.context.object.modifiers["smooth"].render_levels = 2
    bpy.ops.mesh.primitive_cube_add(location=(-3, 0, 0))
    array = bpy.context.object.modifiers.new("three", "ARRAY")
    array.count, array.relative_offset_displace = 3, (0, 1.5, 0)
    bpy.context.object.modifiers.new("rounded", "BEVEL").segments = 3
    # Mirrored by its scale.
    bpy.ops.mesh.primitive_cone_add(location=(0, 4, 0))
    bpy.context.object.scale.x = -1
    compare(tmp_path)


def test_curves_texts_and_metaballs_once_each(tmp_path: Any) -> None:
    bpy.ops.curve.primitive_bezier_circle_add(location=(3, 0, 0), rotation=(1.2, 0, 0.4))
    bpy.context.object.data.bevel_depth = 0.2
    bpy.ops.object.text_add(location=(-3, -1, 0), rotation=(math.pi / 2, 0, math.pi / 2))
    bpy.context.object.data.body, bpy.context.object.data.extrude = "echo", 0.1
    for place in ((0, 3, 0), (1, 3, 0.2)):
        bpy.ops.object.metaball_add(location=place)
        bpy.context.object.data.render_resolution = bpy.context.object.data.resolution
    exported = compare(tmp_path)
    # A family of metaballs is one mesh.
    assert len(names(exported)) == 3


def test_hulls_of_geometry_nodes_and_their_instances(tmp_path: Any) -> None:
    bpy.ops.mesh.primitive_grid_add(size=8, location=(0, 0, -1))
    tree, start, end = clouds.geometry_tree("stones")
    points = tree.nodes.new("GeometryNodeDistributePointsOnFaces")
    stone = tree.nodes.new("GeometryNodeMeshCube")
    stone.inputs["Size"].default_value = (0.3, 0.2, 0.4)
    instance, join = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new("GeometryNodeJoinGeometry")
    for output, target in (
        (start.outputs[0], points.inputs[0]),
        (points.outputs["Points"], instance.inputs["Points"]),
        (points.outputs["Rotation"], instance.inputs["Rotation"]),
        (stone.outputs[0], instance.inputs["Instance"]),
        (instance.outputs[0], join.inputs[0]),
        (start.outputs[0], join.inputs[0]),
        (join.outputs[0], end.inputs[0]),
    ):
        tree.links.new(output, target)
    bpy.context.object.modifiers.new("stones", "NODES").node_group = tree
    exported = compare(tmp_path)
    assert len(exported.seen) > 10
    # Each of them is one instance, of one mesh.
    assert len({one.instance for one in exported.seen.values()}) == len(exported.seen)
    assert len({id(one.mesh) for one in exported.seen.values()}) == 2


def curve_to_mesh(thing: Any) -> None:
    """Nodes that make a tube of a curve along z."""
    tree, _, end = clouds.geometry_tree("Tube")
    line, circle = tree.nodes.new("GeometryNodeCurvePrimitiveLine"), tree.nodes.new("GeometryNodeCurvePrimitiveCircle")
    circle.inputs["Radius"].default_value = 0.1
    tube = tree.nodes.new("GeometryNodeCurveToMesh")
    for output, target in ((line, tube.inputs[0]), (circle, tube.inputs["Profile Curve"]), (tube, end.inputs[0])):
        tree.links.new(output.outputs[0], target)
    thing.modifiers.new("Tube", "NODES").node_group = tree


def test_hair_is_scanned_as_far_as_there_are_meshes_of_it() -> None:
    """The rest is told, once for each object, unless it does not render."""
    cube = makers.cube("Head", 1, (3, 0, 0))
    hair = cube.modifiers.new("Hair", "PARTICLE_SYSTEM")
    hair.particle_system.settings.type, hair.particle_system.settings.render_type = "HAIR", "PATH"
    copy = bpy.data.objects.new("Head", cube.data)
    for name, nodes in (("Bare", False), ("Tubes", True)):
        curves = bpy.data.objects.new(name, bpy.data.hair_curves.new(name))
        bpy.context.scene.collection.objects.link(curves)
        if hasattr(curves.data, "add_curves"):
            curves.data.add_curves([2])
        if nodes:
            curve_to_mesh(curves)
    for thing in (copy, bpy.data.objects.new("Fog", bpy.data.volumes.new("Fog"))):
        bpy.context.scene.collection.objects.link(thing)
    points = makers.plane("Dots")
    tree, start, end = clouds.geometry_tree("Dots")
    node = tree.nodes.new("GeometryNodeMeshToPoints")
    tree.links.new(start.outputs[0], node.inputs[0])
    tree.links.new(node.outputs[0], end.inputs[0])
    points.modifiers.new("Dots", "NODES").node_group = tree
    exported = scene.exported(bpy.context)
    assert names(exported) == ["Head", "Head.001", "Tubes"]
    told = {"hairs of Head", "volumes of Fog", "points of Dots"}
    # Blender 3.4 cannot make curves without a window.
    told |= {"curves of Bare"} if hasattr(bpy.data.objects["Bare"].data, "add_curves") else set()
    assert sorted(exported.notes) == sorted(f"the {one} are not scanned: Blender makes no mesh of them" for one in told)
    cube.show_instancer_for_render = False
    exported = scene.exported(bpy.context)
    assert names(exported) == ["Head.001", "Tubes"] and "the hairs of Head are not scanned" in exported.notes[0]
    cube.show_instancer_for_render = True
    hair.show_render = False
    for name in ("Bare", "Fog", "Dots"):
        bpy.data.objects[name].hide_render = True
    assert not scene.exported(bpy.context).notes


def test_collection_instances_and_particles(tmp_path: Any) -> None:
    trees = bpy.data.collections.new("trees")
    bpy.ops.mesh.primitive_cone_add(location=(0, 0, 1))
    crown = bpy.context.object
    bpy.context.scene.collection.objects.unlink(crown) if crown.name in bpy.context.scene.collection.objects else None
    for one in crown.users_collection:
        one.objects.unlink(crown)
    trees.objects.link(crown)
    for place in ((4, 0, -1), (0, 4, -1)):
        bpy.ops.object.empty_add(location=place)
        bpy.context.object.instance_type, bpy.context.object.instance_collection = "COLLECTION", trees
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.3, location=(50, 0, 0))
    pebble = bpy.context.object
    bpy.ops.mesh.primitive_plane_add(size=8, location=(0, 0, -1))
    bpy.ops.object.particle_system_add()
    settings = bpy.context.object.particle_systems[0].settings
    settings.type, settings.render_type, settings.instance_object = "HAIR", "OBJECT", pebble
    settings.count, settings.particle_size, settings.use_advanced_hair = 40, 1.0, True
    settings.display_step = settings.render_step
    exported = compare(tmp_path)
    assert names(exported).count(crown.name) == 2
    assert names(exported).count(pebble.name) == 41


def test_armatures_and_shape_keys_at_the_frame(tmp_path: Any) -> None:
    bpy.ops.object.armature_add(location=(3, 0, -1))
    rig = bpy.context.object
    bpy.ops.mesh.primitive_cylinder_add(radius=0.3, depth=2, location=(3, 0, 0))
    limb = bpy.context.object
    group = limb.vertex_groups.new(name="Bone")
    group.add([vertex.index for vertex in limb.data.vertices if vertex.co.z > 0], 1.0, "ADD")
    limb.modifiers.new("rig", "ARMATURE").object = rig
    rig.pose.bones["Bone"].rotation_mode = "XYZ"
    rig.pose.bones["Bone"].rotation_euler = (0, 0, 0.8)
    bpy.ops.mesh.primitive_cube_add(location=(-3, 0, 0))
    cube = bpy.context.object
    cube.shape_key_add(name="Basis")
    key = cube.shape_key_add(name="tall")
    for point in key.data:
        point.co.z *= 2
    key.value = 0.0
    key.keyframe_insert("value", frame=1)
    key.value = 1.0
    key.keyframe_insert("value", frame=11)
    for frame in (1, 6, 11):
        bpy.context.scene.frame_set(frame)
        compare(tmp_path)


def test_what_renders_is_scanned() -> None:
    """Whatever the viewport shows."""

    def cube(name: str) -> Any:
        bpy.ops.mesh.primitive_cube_add(location=(5 * len(bpy.data.objects), 0, 0))
        bpy.context.object.name = name
        return bpy.context.object

    def in_collection(name: str) -> Any:
        made = bpy.data.collections.new(name)
        bpy.context.scene.collection.children.link(made)
        thing = cube(name)
        for one in thing.users_collection:
            one.objects.unlink(thing)
        made.objects.link(thing)
        return made

    cube("plain")
    cube("no render").hide_render = True
    in_collection("in no render").hide_render = True
    in_collection("excluded")
    layers = bpy.context.view_layer.layer_collection.children
    layers["excluded"].exclude = True
    emitter = cube("emitter")
    emitter.instance_type, emitter.show_instancer_for_render, emitter.show_instancer_for_viewport = "VERTS", False, False
    assert names(scene.exported(bpy.context)) == ["plain"]
    # From now on the viewport shows less than is rendered.
    cube("eye").hide_set(True)
    cube("monitor").hide_viewport = True
    in_collection("in eye")
    layers["in eye"].hide_viewport = True
    assert names(scene.exported(bpy.context)) == ["eye", "in eye", "monitor", "plain"]
    for name in ("eye", "plain"):
        bpy.data.objects[name].hide_render = True
    assert names(scene.exported(bpy.context)) == ["in eye", "monitor"]


def test_levels_of_rendering_are_used() -> None:
    bpy.ops.mesh.primitive_cube_add()
    smooth = bpy.context.object.modifiers.new("smooth", "SUBSURF")
    smooth.levels, smooth.render_levels = 0, 3
    engine, camera = bpy.context.scene.render.engine, bpy.context.scene.camera
    found = scene.exported(bpy.context)
    assert next(iter(found.seen.values())).mesh.triangles == 6 * 2 * 4**3
    # Nothing else has changed for it.
    assert (bpy.context.scene.render.engine, bpy.context.scene.camera) == (engine, camera)
    assert not bpy.data.cameras and [one.name for one in bpy.data.objects] == ["Cube"]
    smooth.show_render = False
    assert next(iter(scene.exported(bpy.context).seen.values())).mesh.triangles == 12


def test_scale_of_the_scene_and_far_objects(tmp_path: Any) -> None:
    bpy.context.scene.unit_settings.scale_length = 0.01
    bpy.ops.mesh.primitive_cube_add(size=200, location=(1000, 0, 0))
    cloud = scene.exported(bpy.context).live.scan(sphere_sensor(tmp_path), at=(0, 0, 0))
    assert len(cloud) and abs(cloud.range.min() - 9) < 1e-3


def test_only_what_has_changed_is_read_again(monkeypatch: pytest.MonkeyPatch) -> None:
    from echocast_blender import geometry

    read: "list[str]" = []
    original = geometry.mesh_of
    monkeypatch.setattr(geometry, "mesh_of", lambda name, *rest: (read.append(name), original(name, *rest))[1])

    def again() -> "list[str]":
        read.clear()
        scene.exported(bpy.context)
        return sorted(read)

    paint = material("paint")
    for index in range(3):
        bpy.ops.mesh.primitive_cube_add(location=(4 * index, 0, 0))
        bpy.context.object.name = f"cube {index}"
    cubes = [bpy.data.objects[f"cube {index}"] for index in range(3)]
    cubes[1].data.materials.append(paint)
    twin = bpy.data.objects.new("twin", cubes[0].data)
    bpy.context.collection.objects.link(twin)
    # The twin shares the mesh of the first.
    assert len(again()) == 3
    assert again() == []
    cubes[0].location.z = 2
    assert again() == []
    cubes[2].data.vertices[0].co.x -= 0.5
    cubes[2].data.update()
    assert again() == ["cube 2"]
    paint.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 0.1
    assert again() == ["cube 1"]
    cubes[2].data.materials.append(paint)
    assert again() == ["cube 2"]
    bpy.data.objects.remove(cubes[1])
    assert again() == []
    exported = scene.exported(bpy.context)
    assert names(exported) == ["cube 0", "cube 2", "twin"]


def test_nothing_of_results_is_scanned() -> None:
    bpy.ops.mesh.primitive_cube_add(location=(5, 0, 0))
    bpy.ops.echocast.add_sensor(preset="velodyne_vlp16")
    bpy.ops.echocast.scan()
    results = [one for one in bpy.data.objects if scene.RESULT in one]
    assert len(results) == 1
    results[0].hide_render = False
    assert names(scene.exported(bpy.context)) == ["Cube"]


def test_differences_between_viewport_and_rendering_are_noticed() -> None:
    context = bpy.context
    bpy.ops.mesh.primitive_cube_add()
    thing = context.object
    assert not evaluated.differs(context.scene, context.view_layer)
    thing.hide_set(True)
    assert evaluated.differs(context.scene, context.view_layer)
    thing.hide_render = True
    assert not evaluated.differs(context.scene, context.view_layer)
    thing.hide_render = False
    thing.hide_set(False)
    context.scene.render.use_simplify = True
    assert evaluated.differs(context.scene, context.view_layer)
