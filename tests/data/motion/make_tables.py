"""Evaluates the files of this folder in Blender and by the specification and writes the tables.

usage: blender -b --factory-startup --python make_tables.py
"""

import math
import sys
from pathlib import Path

import bpy
import numpy
from mathutils import Quaternion

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import make_files
import spec

# The importer of Blender 3.4 asks for a name that newer numpys no longer have.
numpy.bool = bool

# Keys at whole milliseconds lie on whole frames.
FPS = 1000

TIMES = {
    "trs_linear": [0.0, 0.5, 0.8, 1.0, 1.6, 2.2, 2.5, 3.1, 3.4567, 4.0, 5.0],
    "trs_step": [0.0, 0.5, 0.999, 1.0, 1.5, 1.7501, 2.5, 2.999, 3.25, 3.5, 6.0],
    "trs_cubic": [0.0, 0.25, 0.7, 1.0, 1.1234, 1.6, 1.9, 2.3, 2.9, 4.0],
    "skin4": [0.0, 0.5, 0.9, 1.25, 1.5, 1.7654, 2.2, 2.6, 3.0, 4.5],
    "skin8": [0.0, 0.3, 0.5, 0.9, 1.25, 1.8765, 2.2, 3.0],
    "morph": [0.0, 0.5, 0.7, 1.2, 1.5, 1.8, 2.0, 2.4321, 4.0],
    "morph_cubic": [0.0, 0.5, 0.8, 1.1, 1.5, 1.9876, 2.6, 3.0, 3.5],
    "morph_skin": [0.0, 0.4, 0.75, 1.0, 1.3, 1.6543, 2.0, 2.3, 3.0],
    "two_clips": [0.0, 0.5, 0.9, 1.5, 2.0, 2.6, 3.0, 4.0],
}
# No file has a clip of this name: all of its clips at once.
ALL = "*"


def load(path, clips):
    """Imports a file into an empty scene and lets the animations `clips` (names) play there, and no other."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = FPS
    bpy.ops.import_scene.gltf(filepath=str(path), merge_vertices=False, bone_heuristic="BLENDER")
    for owner in animated():
        actions = {track.name: track.strips[0].action for track in owner.animation_data.nla_tracks}
        chosen = [action for name, action in actions.items() if name in clips]
        # An object plays one action at a time; the clips here have no node in common.
        assert len(chosen) <= 1
        owner.animation_data.action = chosen[0] if chosen else None


def animated():
    """Whatever has animations: objects and shape keys."""
    owners = [*bpy.data.objects, *bpy.data.shape_keys]
    return [owner for owner in owners if owner.animation_data]


def curves(path):
    """F-curves by owner and data path, those whose path ends in `path`, in the order of their components."""
    found = {}
    for owner in animated():
        action = owner.animation_data.action
        for curve in action.fcurves if action else ():
            if curve.data_path.endswith(path):
                found.setdefault((owner.name, curve.data_path), []).append(curve)
    return {key: sorted(group, key=lambda curve: curve.array_index) for key, group in found.items()}


def mend(file, clips, times):
    """Makes the curves what the file says; the importer leaves three things out."""
    # 1. LINEAR rotations: further keys at the times wanted, on the arc as Blender's own slerp finds it.
    for group in curves("rotation_quaternion").values():
        if group[0].keyframe_points[0].interpolation != "LINEAR":
            continue
        keys = [point.co[0] for point in group[0].keyframe_points]
        values = [Quaternion([curve.keyframe_points[i].co[1] for curve in group]) for i in range(len(keys))]
        for frame in (time * FPS for time in times):
            key = max((i for i in range(len(keys)) if keys[i] <= frame), default=None)
            if key is None or key + 1 == len(keys):
                continue
            between = values[key].slerp(values[key + 1], (frame - keys[key]) / (keys[key + 1] - keys[key]))
            for curve, value in zip(group, between):
                curve.keyframe_points.insert(frame, value).interpolation = "LINEAR"
    # 2. The tangents of CUBICSPLINE: a Bezier curve whose handles are a third of the way off is Hermite's.
    for clip in file.json["animations"]:
        for channel in clip["channels"] if clip["name"] in clips else ():
            sampler = clip["samplers"][channel["sampler"]]
            if sampler.get("interpolation") == "CUBICSPLINE":
                node = file.nodes[channel["target"]["node"]]["name"]
                tangents(file, sampler, channel["target"]["path"], node)
    # 3. Weights outside the range of the slider, which is 0 to 1 and the first key.
    for key in bpy.data.shape_keys:
        for block in key.key_blocks:
            block.slider_min, block.slider_max = -10.0, 10.0


def tangents(file, sampler, path, node):
    """Bends the curves of a channel as its tangents say, which are values per second."""
    rows = file.rows(sampler["output"])
    if path == "weights":
        width = len(rows) // (3 * len(file.rows(sampler["input"])))
        rows = [[row[0] for row in rows[i : i + width]] for i in range(0, len(rows), width)]
        (key,) = bpy.data.shape_keys
        group = [key.animation_data.action.fcurves.find(f'key_blocks["{b.name}"].value') for b in key.key_blocks[1:]]
    else:
        rows = [as_blender(path, row) for row in rows]
        name = {"translation": "location", "rotation": "rotation_quaternion", "scale": "scale"}[path]
        group = curves(name)[node, name]
    for component, curve in enumerate(group):
        points = curve.keyframe_points
        frames = [point.co[0] for point in points]
        for i, point in enumerate(points):
            point.handle_left_type = point.handle_right_type = "FREE"
            before = (frames[i] - frames[i - 1]) / 3 if i else 1.0
            behind = (frames[i + 1] - frames[i]) / 3 if i + 1 < len(points) else 1.0
            arriving, value, leaving = (rows[3 * i + part][component] for part in range(3))
            assert math.isclose(value, point.co[1], abs_tol=1e-6)
            point.handle_left = (frames[i] - before, value - arriving * before / FPS)
            point.handle_right = (frames[i] + behind, value + leaving * behind / FPS)


def as_blender(path, row):
    """A value of an object's own transform with z up, as the importer has it."""
    if path == "rotation":
        x, y, z, w = row
        return (w, x, -z, y)
    x, y, z = row
    return (x, -z, y) if path == "translation" else (x, z, y)


def evaluated(file, time):
    """World positions of the vertices, and poses of the cameras, by the name of their node."""
    frame = round(time * FPS, 6)
    bpy.context.scene.frame_set(int(frame), subframe=frame - int(frame))
    graph = bpy.context.evaluated_depsgraph_get()
    meshes, cameras = {}, {}
    for thing in bpy.context.scene.objects:
        # Nothing in glTF 2.0 itself hides an object.
        assert thing.visible_get() and not thing.hide_render
        thing = thing.evaluated_get(graph)
        world = tuple(value for column in thing.matrix_world.col for value in column)
        if thing.type == "MESH":
            mesh = thing.to_mesh()
            meshes[node_of(file, thing)] = [spec.point(world, vertex.co) for vertex in mesh.vertices]
            thing.to_mesh_clear()
        elif thing.type == "CAMERA":
            cameras[thing.name] = spec.pose(*(world[i : i + 3] for i in (12, 8, 4)))
    return meshes, cameras


def node_of(file, thing):
    """A skinned mesh whose node is animated comes as an object of its own, named after the mesh."""
    names = [node["name"] for node in file.nodes if "mesh" in node]
    # Joints, armatures and the nodes left behind keep their names.
    return thing.name if thing.name in names else thing.data.name


def check_order(file):
    """The vertices of Blender's meshes are those of the file, in its order; those of skins it moves at once."""
    for thing in bpy.data.objects:
        if thing.type != "MESH":
            continue
        node = next(node for node in file.nodes if node["name"] == node_of(file, thing))
        (primitive,) = file.json["meshes"][node["mesh"]]["primitives"]
        positions = file.rows(primitive["attributes"]["POSITION"])
        assert len(positions) == len(thing.data.vertices)
        corners = [corner for (corner,) in file.rows(primitive["indices"])]
        assert corners == [loop.vertex_index for loop in thing.data.loops]
        if "skin" not in node:
            for position, vertex in zip(positions, thing.data.vertices):
                assert math.dist(spec.z_up(position), vertex.co) == 0.0


def difference(one, other):
    """Greatest distance between places of the same thing."""
    assert one.keys() == other.keys()
    return max((math.dist(p, q) for key in one for p, q in zip(one[key], other[key], strict=True)), default=0.0)


def furthest(one, other):
    """Greatest difference of a number in the poses of the same cameras."""
    return max((abs(a - b) for key in one for a, b in zip(one[key], other[key], strict=True)), default=0.0)


def scenes():
    vertices, cameras = [], []
    print("\nGreatest difference, blender - spec (m, cameras), mended - spec (m, cameras), blender - nlerp (m):")
    for name, times in TIMES.items():
        names = [clip["name"] for clip in spec.File(HERE / f"{name}.glb").json["animations"]]
        for clip in names if len(names) == 1 else [*names, ALL]:
            found = evaluated_thrice(HERE / f"{name}.glb", names if clip == ALL else [clip], times)
            for who, thing, time, vertex, place in found[0]:
                vertices.append((who, name, clip, thing, time, vertex, *map(number, place)))
            for who, thing, time, place in found[1]:
                cameras.append((who, name, clip, thing, time, *map(number, place)))
            print(f"{name} {clip}: " + " ".join(f"{value:.2g}" for value in found[2]))
    table("vertices.csv", "evaluator,file,clip,object,time_s,vertex,x,y,z", vertices)
    table("cameras.csv", "evaluator,file,clip,object,time_s,x,y,z,view_x,view_y,view_z,up_x,up_y,up_z", cameras)


def evaluated_thrice(path, clips, times):
    """Vertices and cameras by the three evaluators, and how far these are apart."""
    file = spec.File(path)
    numbers = [index for index, clip in enumerate(file.json["animations"]) if clip["name"] in clips]
    found = {"spec": {time: (file.vertices(numbers, time), file.cameras(numbers, time)) for time in times}}
    load(path, clips)
    check_order(file)
    found["blender"] = {time: evaluated(file, time) for time in times}
    mend(file, clips, times)
    found["mended"] = {time: evaluated(file, time) for time in times}

    apart = []
    for who in ("blender", "mended"):
        pairs = [(found[who][time], found["spec"][time]) for time in times]
        apart.append(max(difference(one[0], other[0]) for one, other in pairs))
        apart.append(max(furthest(one[1], other[1]) for one, other in pairs))
    assert max(apart[2:]) < 1e-5, (path.name, apart)
    if max(apart[:2]) < 1e-5:
        # Blender follows the specification by itself.
        del found["mended"]
    # Is it the rotations alone?
    straight = spec.File(path, spec.nlerp)
    apart.append(max(difference(straight.vertices(numbers, time), found["blender"][time][0]) for time in times))

    rows = [(who, time, *both) for who, by_time in found.items() for time, both in by_time.items()]
    return (
        [
            (who, thing, time, vertex, place)
            for who, time, meshes, _ in rows
            for thing, places in meshes.items()
            for vertex, place in enumerate(places)
        ],
        [(who, thing, time, place) for who, time, _, poses in rows for thing, place in poses.items()],
        apart,
    )


def caches():
    """The flag, as the Mesh Cache modifier bends it between its samples."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    fps = bpy.context.scene.render.fps = 25
    bpy.ops.import_scene.gltf(filepath=str(HERE / "flag.glb"), merge_vertices=False)
    (thing,) = bpy.context.scene.objects
    check_order(spec.File(HERE / "flag.glb"))
    cache = thing.modifiers.new("cache", "MESH_CACHE")
    cache.play_mode, cache.interpolation = "CUSTOM", "LINEAR"
    # The cache holds y up, the imported mesh z up: of the 24 settings this is (x, -z, y).
    cache.forward_axis, cache.up_axis = "POS_Z", "NEG_Y"
    samples = [[spec.z_up(vertex) for vertex in make_files.flag_at(time)[0]] for time in make_files.FLAG_TIMES]
    rows = []
    for name, unit, ats in [
        ("flag.mdd", "second", [0.0, 0.5, 0.6, 0.8125, 1.0, 1.8, 2.9, 3.0, 4.0]),
        ("flag.mdd", "sample", [0.25, 3.6]),
        ("flag.pc2", "frame", [0.0, 5.0, 6.0, 10.0, 11.25, 16.8, 17.5, 30.0]),
        ("flag.pc2", "sample", [0.25, 3.6]),
    ]:
        cache.cache_format, cache.filepath = name[-3:].upper(), str(HERE / name)
        cache.time_mode = "FRAME" if unit == "sample" else "TIME"
        for at in ats:
            if unit == "sample":
                cache.eval_frame = sample = at
            elif unit == "second":
                cache.eval_time = at
                sample = sample_at(at)
            else:
                # Blender divides seconds by the frame rate where it should multiply.
                cache.eval_time = at * fps
                sample = (at - make_files.FLAG_START) / make_files.FLAG_RATE
            mesh = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
            sample = min(max(sample, 0.0), len(samples) - 1.0)
            before = min(int(sample), len(samples) - 2)
            for index, vertex in enumerate(mesh.vertices):
                wanted = spec.lerp(samples[before][index], samples[before + 1][index], sample - before)
                assert math.dist(wanted, vertex.co) < 1e-6, (name, unit, at, index)
                rows.append((name, unit, at, index, *map(number, vertex.co)))
    table("caches.csv", "file,unit,at,vertex,x,y,z", rows)


def sample_at(time):
    """Number of the sample, with a fraction, by the times in the MDD file."""
    times = make_files.FLAG_TIMES
    time = min(max(time, times[0]), times[-1])
    before = max(i for i in range(len(times) - 1) if times[i] <= time)
    return before + (time - times[before]) / (times[before + 1] - times[before])


def number(value):
    """To the micrometre, without the sign of a zero."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def table(name, head, rows):
    lines = [head, *(",".join(map(str, row)) for row in rows)]
    (HERE / name).write_text("\n".join(lines) + "\n")


def main():
    make_files.write()
    scenes()
    caches()


try:
    main()
except BaseException:
    # Blender goes on after an error and calls it a success.
    import traceback

    traceback.print_exc()
    sys.exit(1)
