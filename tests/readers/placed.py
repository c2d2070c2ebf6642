"""Makes scenes to place things in, and measures what a set of samples has placed there.

usage: placed.py make FOLDER         writes FOLDER/room.glb and FOLDER/models
       placed.py measure FOLDER SET  prints JSON

Meshes are placed by nothing but `drawn` of the samples and measured by trimesh and FCL. One list element per object of
a sample, in the order in which they got there: its rule, how high its foot is above the surface below (`foot_m`), its lowest vertex above its foot (`lowest_m`), how far vertices reach into the ground (`sunk_m`), the angle
between its own z axis and the normal of the surface (`tilt_deg`), the distance to what was there before, without the
ground (`away_m`, below 0 where they overlap, null without any), and its scanned points, with the largest distance from
its surface (`missed_m`).
"""

import json
import sys
from pathlib import Path

import numpy
import trimesh
from trimesh import creation
from trimesh import transformations as turns

# glTF is y up, the rest is z up.
UP = turns.rotation_matrix(numpy.pi / 2, [1, 0, 0])
GROUND = ("Floor", "Hill")


def block(size, at):
    return creation.box(size, turns.translation_matrix(at))


def hill():
    """On from x = 10 where the floor ends, up to 30 degrees steep."""
    x, y = numpy.meshgrid(numpy.linspace(10, 30, 81), numpy.linspace(-10, 10, 81), indexing="ij")
    z = 0.25 * (x - 10) + 0.5 * numpy.sin(0.7 * y) * numpy.sin(0.5 * (x - 10))
    k = numpy.arange(81 * 81).reshape(81, 81)
    a, b, c, d = (part.ravel() for part in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]))
    faces = numpy.concatenate([numpy.stack([a, b, c], 1), numpy.stack([a, c, d], 1)])
    return trimesh.Trimesh(numpy.stack([x, y, z], -1).reshape(-1, 3), faces)


def write(path, nodes):
    """Nodes are (name, mesh, transform) in metres, z up."""
    scene = trimesh.Scene()
    for name, mesh, transform in nodes:
        scene.add_geometry(mesh, node_name=name, geom_name=f"{name} mesh", transform=numpy.linalg.inv(UP) @ transform)
    path.write_bytes(scene.export(file_type="glb"))


def make(folder):
    here = numpy.eye(4)
    chair = trimesh.util.concatenate([block([0.5, 0.5, 0.45], [0.4, 0, 0.225]), block([0.1, 0.5, 0.5], [0.2, 0, 0.7])])
    nodes = [("Floor", block([20, 20, 0.1], [0, 0, -0.05]), here), ("Hill", hill(), here)]
    for k in range(6):
        place = turns.translation_matrix([-8 + 2 * k, 3, 0]) @ turns.rotation_matrix(0.4 * k, [0, 0, 1])
        nodes.append((f"Chair_{k}", chair, place))
    write(folder / "room.glb", nodes)
    models = folder / "models"
    models.mkdir()
    # None has its origin at its foot.
    write(models / "crate.glb", [("crate", block([1, 0.6, 0.4], [0.1, 0, 0.05]), here)])
    write(models / "pole.glb", [("pole", creation.cylinder(0.06, 1.8), here)])
    tilted = turns.translation_matrix([0, 0, 3]) @ turns.rotation_matrix(0.6, [1, 0, 0])
    write(models / "ball.glb", [("ball", creation.icosphere(2, 0.35), tilted)])
    leg = creation.cylinder(0.08, 0.6)
    leaning = [turns.translation_matrix([x, 0, 0.2]) @ turns.rotation_matrix(x, [0, 1, 0]) for x in (-0.5, 0.5)]
    seat = ("seat", block([1.5, 0.5, 0.06], [0, 0, 0.5]), here)
    write(models / "bench.glb", [seat, ("left", leg, leaning[0]), ("right", leg, leaning[1])])


def load(path):
    """The nodes of a file in the world, z up."""
    scene = trimesh.load_scene(path, process=False)
    meshes = {}
    for node in scene.graph.nodes_geometry:
        transform, geometry = scene.graph[node]
        meshes[node] = scene.geometry[geometry].copy().apply_transform(UP @ transform)
    return meshes


def turned(entry):
    """The matrix of the turn."""
    if whole := entry.get("orientation_xyzw"):
        return turns.quaternion_matrix(whole[3:] + whole[:3])
    turn = entry.get("turn_deg", 0)
    return turns.euler_matrix(*numpy.radians(turn if isinstance(turn, list) else [0, 0, turn]))


def placed(folder, drawn):
    """The meshes of the room and of what was placed, and what was drawn last for each, in this order."""
    meshes, entries = load(folder / "room.glb"), {}
    for entry in drawn:
        name = entry["object"]
        assert not entry.get("skipped"), entry
        if "model" in entry:
            meshes[name] = trimesh.util.concatenate(list(load(folder / entry["model"]).values()))
            pivot = numpy.array([0, 0, meshes[name].bounds[0, 2]])
        else:
            pivot = numpy.subtract(entry["position_m"], entry["moved_m"])
        to, back = turns.translation_matrix(entry["position_m"]), turns.translation_matrix(-pivot)
        scale = numpy.diag([*numpy.broadcast_to(entry.get("scale", 1), 3), 1])
        meshes[name].apply_transform(to @ turned(entry) @ scale @ back)
        entries.pop(name, None)
        entries[name] = entry
    return meshes, entries


def below(meshes, points):
    """Height and normal of the highest surface below each point; far down where there is none."""
    heights, normals = numpy.full(len(points), -1e3), numpy.zeros((len(points), 3))
    for mesh in meshes:
        down = numpy.tile([0.0, 0, -1], (len(points), 1))
        hits, rays, triangles = mesh.ray.intersects_location(points, down)
        for hit, ray, triangle in zip(hits, rays, triangles):
            if hit[2] > heights[ray]:
                heights[ray], normals[ray] = hit[2], mesh.face_normals[triangle]
    return heights, normals


def contained(mesh, others):
    """Whether its first vertex is in one of the others, or theirs in it: then their surfaces need not meet."""
    return any(other.contains(mesh.vertices[:1])[0] or mesh.contains(other.vertices[:1])[0] for other in others)


def points_by_name(path):
    with numpy.load(path) as cloud:
        names = dict(zip(cloud["instance_ids"].tolist(), cloud["instance_names"].tolist()))
        points = numpy.stack([cloud[axis] for axis in "xyz"], 1) + cloud["origin"]
        return {name: points[cloud["instance_id"] == number] for number, name in names.items()}


def measure(folder, root, number):
    drawn = json.loads((root / f"samples/{number:06}.json").read_text())["drawn"]
    meshes, entries = placed(folder, drawn)
    scanned = points_by_name(next((root / f"data/{number:06}").glob("*.npz")))
    ground = [meshes[name] for name in GROUND]
    before, there = [], trimesh.collision.CollisionManager()
    for name, entry in entries.items():
        mesh = meshes[name]
        foot = numpy.array(entry["position_m"])
        # From a little higher: the foot may be on the surface to the last bit.
        heights, normals = below([*ground, *before], [foot + [0, 0, 0.01]])
        over_ground = mesh.vertices[:, 2] - below(ground, mesh.vertices + [0, 0, 10])[0]
        away = None
        if before:
            away = -1e3 if contained(mesh, before) else there.min_distance_single(mesh)
        points = scanned.get(name, numpy.zeros((0, 3)))
        missed = trimesh.proximity.closest_point(mesh, points)[1].max() if len(points) else 0
        yield {
            "name": name,
            "rule": entry["rule"],
            "foot_m": foot[2] - heights[0],
            "lowest_m": mesh.bounds[0, 2] - foot[2],
            "sunk_m": -over_ground.min(),
            "tilt_deg": numpy.degrees(numpy.arccos(min(1, turned(entry)[:3, 2] @ normals[0]))),
            "away_m": away,
            "points": len(points),
            "missed_m": missed,
        }
        before.append(mesh)
        there.add_object(name, mesh)


command, folder = sys.argv[1], Path(sys.argv[2])
if command == "make":
    make(folder)
else:
    root = Path(sys.argv[3])
    samples = sorted(int(path.stem) for path in (root / "samples").glob("*.json"))
    json.dump([row for number in samples for row in measure(folder, root, number)], sys.stdout)
