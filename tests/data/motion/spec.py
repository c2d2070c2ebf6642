"""Evaluates a GLB file at a time as glTF 2.0 says, in double precision, with nothing but Python.

Of the specification: 3.6.2 (accessors), 3.7.2.2 (morph targets), 3.7.3 (skins), 3.11 and appendix C (animations).
"""

import json
import math
import struct

LETTER = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}
LARGEST = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0}
WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
IDENTITY = (1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def slerp(p, q, t):
    """Appendix C.4: the short way round."""
    cosine = sum(a * b for a, b in zip(p, q))
    if cosine < 0.0:
        q, cosine = [-value for value in q], -cosine
    angle = math.acos(min(cosine, 1.0))
    if angle < 1e-9:
        return lerp(p, q, t)
    u, v = math.sin(angle * (1.0 - t)), math.sin(angle * t)
    return [(u * a + v * b) / math.sin(angle) for a, b in zip(p, q)]


def nlerp(p, q, t):
    """What Blender's importer makes of it: a line in four dimensions, its points drawn back to the sphere."""
    if sum(a * b for a, b in zip(p, q)) < 0.0:
        q = [-value for value in q]
    return unit(lerp(p, q, t))


def lerp(p, q, t):
    return [a + (b - a) * t for a, b in zip(p, q)]


def unit(q):
    length = math.sqrt(sum(value * value for value in q))
    return [value / length for value in q]


def after(a, b):
    """Product of two matrices, columns one after the other: first b, then a."""
    return tuple(
        sum(a[4 * k + row] * b[4 * column + k] for k in range(4)) for column in range(4) for row in range(4)
    )


def point(m, p):
    return [m[row] * p[0] + m[4 + row] * p[1] + m[8 + row] * p[2] + m[12 + row] for row in range(3)]


def composed(translation, rotation, scale):
    x, y, z, w = unit(rotation)
    axes = (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )
    columns = [value for axis, s in zip(axes, scale) for value in (*(s * part for part in axis), 0.0)]
    return (*columns, *translation, 1.0)


def z_up(p):
    x, y, z = p
    return [x, -z, y]


class File:
    """A GLB file; `turn` is how rotations between LINEAR keys are found."""

    def __init__(self, path, turn=slerp):
        data = path.read_bytes()
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        self.json = json.loads(data[20 : 20 + size])
        self.bytes = data[28 + size :]
        self.turn = turn
        self.nodes = self.json["nodes"]

    def rows(self, index):
        """The tuples of an accessor."""
        accessor = self.json["accessors"][index]
        kind, width = accessor["componentType"], WIDTH[accessor["type"]]
        rows = [(0,) * width] * accessor["count"]
        if "bufferView" in accessor:
            rows = self.packed(accessor["bufferView"], accessor.get("byteOffset", 0), kind, width, len(rows))
        if "sparse" in accessor:
            count, where, what = (accessor["sparse"][key] for key in ("count", "indices", "values"))
            where = self.packed(where["bufferView"], where.get("byteOffset", 0), where["componentType"], 1, count)
            what = self.packed(what["bufferView"], what.get("byteOffset", 0), kind, width, count)
            for (row,), values in zip(where, what):
                rows[row] = values
        if accessor.get("normalized"):
            rows = [tuple(max(value / LARGEST[kind], -1.0) for value in row) for row in rows]
        return rows

    def packed(self, view, offset, kind, width, count):
        view = self.json["bufferViews"][view]
        form = f"<{width}{LETTER[kind]}"
        stride = view.get("byteStride", struct.calcsize(form))
        start = view.get("byteOffset", 0) + offset
        return [struct.unpack_from(form, self.bytes, start + i * stride) for i in range(count)]

    def sampled(self, sampler, path, time):
        """Value of a sampler: 3 or 4 numbers, or all the weights."""
        times = [row[0] for row in self.rows(sampler["input"])]
        values = self.rows(sampler["output"])
        way = sampler.get("interpolation", "LINEAR")
        if path == "weights":
            width = len(values) // len(times) // (3 if way == "CUBICSPLINE" else 1)
            values = [[row[0] for row in values[i : i + width]] for i in range(0, len(values), width)]
        if path == "rotation" and way != "CUBICSPLINE":
            values = [unit(value) for value in values]
        # In front of the first key and behind the last one their values hold.
        time = min(max(time, times[0]), times[-1])
        key = max(i for i in range(len(times)) if times[i] <= time)
        if way == "CUBICSPLINE":
            _, here, leaving = values[3 * key : 3 * key + 3]
        else:
            here = values[key]
        if way == "STEP" or key + 1 == len(times):
            return here
        span = times[key + 1] - times[key]
        t = (time - times[key]) / span
        if way == "LINEAR":
            return (self.turn if path == "rotation" else lerp)(here, values[key + 1], t)
        arriving, there, _ = values[3 * key + 3 : 3 * key + 6]
        return [
            (2 * t**3 - 3 * t**2 + 1) * v0
            + span * (t**3 - 2 * t**2 + t) * b
            + (3 * t**2 - 2 * t**3) * v1
            + span * (t**3 - t**2) * a
            for v0, b, a, v1 in zip(here, leaving, arriving, there)
        ]

    def posed(self, clips, time):
        """World matrix and weights of every node while the animations `clips` (numbers) play."""
        state = [dict(node) for node in self.nodes]
        for clip in clips:
            clip = self.json["animations"][clip]
            for channel in clip["channels"]:
                path = channel["target"]["path"]
                value = self.sampled(clip["samplers"][channel["sampler"]], path, time)
                state[channel["target"]["node"]][path] = value
        world = [None] * len(state)

        def visit(node, parent):
            own = state[node]
            trs = (own.get("translation", (0, 0, 0)), own.get("rotation", (0, 0, 0, 1)), own.get("scale", (1, 1, 1)))
            world[node] = after(parent, own["matrix"] if "matrix" in own else composed(*trs))
            for child in own.get("children", ()):
                visit(child, world[node])

        for root in self.json["scenes"][self.json["scene"]]["nodes"]:
            visit(root, IDENTITY)
        return world, [own.get("weights") for own in state]

    def vertices(self, clips, time):
        """World positions of the vertices of every mesh, z up, by the name of its node."""
        world, weights = self.posed(clips, time)
        return {
            node["name"]: [z_up(p) for p in self.deformed(node, world, world[index], weights[index])]
            for index, node in enumerate(self.nodes)
            if "mesh" in node
        }

    def deformed(self, node, world, own, weights):
        mesh = self.json["meshes"][node["mesh"]]
        (primitive,) = mesh["primitives"]
        attributes = primitive["attributes"]
        positions = self.rows(attributes["POSITION"])
        targets = [self.rows(target["POSITION"]) for target in primitive.get("targets", ())]
        if weights is None:
            weights = mesh.get("weights", [0.0] * len(targets))
        for weight, target in zip(weights, targets):
            positions = [[a + weight * b for a, b in zip(p, delta)] for p, delta in zip(positions, target)]
        if "skin" not in node:
            return [point(own, p) for p in positions]
        skin = self.json["skins"][node["skin"]]
        matrices = [
            after(world[joint], bind) for joint, bind in zip(skin["joints"], self.rows(skin["inverseBindMatrices"]))
        ]
        influences = [[] for _ in positions]
        half = 0
        while f"JOINTS_{half}" in attributes:
            joints, shares = self.rows(attributes[f"JOINTS_{half}"]), self.rows(attributes[f"WEIGHTS_{half}"])
            for vertex, pair in enumerate(zip(joints, shares)):
                influences[vertex] += [(matrices[joint], share) for joint, share in zip(*pair) if share]
            half += 1
        return [
            [sum(column) for column in zip(*([share * value for value in point(m, p)] for m, share in found))]
            for p, found in zip(positions, influences)
        ]

    def cameras(self, clips, time):
        """Place, view and up of every camera, z up, by the name of its node."""
        world, _ = self.posed(clips, time)
        return {
            node["name"]: pose(*(z_up(world[index][i : i + 3]) for i in (12, 8, 4)))
            for index, node in enumerate(self.nodes)
            if "camera" in node
        }


def pose(place, back, up):
    """Place, and the directions of the view and of up, the latter square to the former whatever shears the node."""
    view = unit([-value for value in back])
    along = sum(a * b for a, b in zip(view, up))
    return [*place, *view, *unit([a - along * b for a, b in zip(up, view)])]
