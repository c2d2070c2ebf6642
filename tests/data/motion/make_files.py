"""Writes the scenes and caches of this folder; nothing but Python is needed."""

import math
import struct
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from glb import ARRAY_BUFFER, FLOAT, SHORT, UBYTE, USHORT, Glb, encode, single


def turn(axis, degrees):
    """Quaternion x y z w."""
    length = math.sqrt(sum(value * value for value in axis))
    half = math.radians(degrees) / 2
    return tuple(value / length * math.sin(half) for value in axis) + (math.cos(half),)


def short_turn(axis, degrees):
    """The next turn whose quaternion is a unit even in 16 bits: it must not matter when a reader makes it one."""
    while True:
        rotation = turn(axis, degrees)
        stored = [round(value * 32767) / 32767 for value in rotation]
        if abs(math.sqrt(sum(value * value for value in stored)) - 1) < 5e-7:
            return rotation
        degrees += 0.01


def minus(values):
    return tuple(-value for value in values)


def times(p, q):
    """Product of two quaternions: first q, then p."""
    px, py, pz, pw = p
    qx, qy, qz, qw = q
    return (
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
        pw * qw - px * qx - py * qy - pz * qz,
    )


def columns(translation, rotation):
    """Rigid 4x4 matrix, its columns one after the other."""
    x, y, z, w = rotation
    return (
        *(1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0.0),
        *(2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0.0),
        *(2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0.0),
        *(*translation, 1.0),
    )


def inverse(matrix):
    """Of a rigid matrix."""
    x, y, z, t = (matrix[i : i + 3] for i in (0, 4, 8, 12))
    back = [-sum(a * b for a, b in zip(axis, t)) for axis in (x, y, z)]
    return (x[0], y[0], z[0], 0.0, x[1], y[1], z[1], 0.0, x[2], y[2], z[2], 0.0, *back, 1.0)


def after(a, b):
    """Product of two matrices: first b, then a."""
    return tuple(
        sum(a[4 * k + row] * b[4 * column + k] for k in range(4)) for column in range(4) for row in range(4)
    )


# No two corners can be mistaken for each other.
WEDGE = [(-0.6, -0.2, 0.4), (0.7, -0.2, 0.3), (0.5, -0.3, -0.6), (-0.4, -0.1, -0.5), (-0.3, 0.4, 0.1), (0.4, 0.6, 0.0)]
WEDGE_SIDES = [(0, 1, 5), (0, 5, 4), (1, 2, 5), (2, 3, 4), (2, 4, 5), (3, 0, 4), (0, 3, 2), (0, 2, 1)]


def grid(across, down, corner):
    """Vertices row by row, and two triangles per cell."""
    vertices = [corner(i, j) for j in range(down) for i in range(across)]
    triangles = []
    for j in range(down - 1):
        for i in range(across - 1):
            a = j * across + i
            triangles += [(a, a + 1, a + across + 1), (a, a + across + 1, a + across)]
    return vertices, triangles


def bar(rings, step):
    """An upright bar of four sides along y."""
    vertices = []
    for ring in range(rings):
        for side in range(4):
            angle = math.pi / 2 * side + 0.3
            vertices.append((0.25 * math.cos(angle), ring * step, 0.2 * math.sin(angle)))
    triangles = []
    for ring in range(rings - 1):
        for side in range(4):
            a, b = 4 * ring + side, 4 * ring + (side + 1) % 4
            triangles += [(a, a + 4, b), (b, a + 4, b + 4)]
    return vertices, triangles


def shares(row, whole):
    """`row` in proportion, as integers that add up to `whole`."""
    exact = [value * whole / sum(row) for value in row]
    rounded = [math.floor(value) for value in exact]
    by_loss = sorted(range(len(row)), key=lambda i: rounded[i] - exact[i])
    for i in by_loss[: whole - sum(rounded)]:
        rounded[i] += 1
    assert sum(rounded) == whole
    return rounded


def trs_linear():
    file = Glb()
    carrier = file.node("carrier", mesh=file.mesh("carrier", WEDGE, WEDGE_SIDES), translation=[9.0, 9.0, 9.0])
    arm = file.node(
        "arm",
        carrier,
        mesh=file.mesh("arm", [(2 * x, y + 0.5, z) for x, y, z in WEDGE], WEDGE_SIDES),
        translation=[0.5, 1.0, -0.25],
        scale=[0.75, 1.5, 0.5],
    )
    lens = file.push("cameras", {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}})
    eye = file.node("eye", arm, camera=lens, scale=[1.0, 2.0, 0.5])
    file.clip("drive")
    file.channel(
        carrier, "translation", [0.5, 1.25, 2.5, 4.0], [(0, 0, 0), (2.5, 0.5, -1), (3, -0.75, -4), (-1, 0.25, -2)]
    )
    # 170 degrees apart; then the other sign; then the same turn twice, once with the other sign.
    a, b, c = turn((0, 1, 0), 10), turn((0, 1, 0.2), 179), turn((1, 0.3, -0.5), 130)
    file.channel(carrier, "rotation", [0.5, 1.0, 2.0, 2.75, 3.5, 4.25], [a, b, minus(c), c, c, turn((1, 2, 3), 75)])
    file.channel(carrier, "scale", [1.0, 3.0], [(1.0, 1.5, 0.5), (0.5, 1.0, 2.5)])
    file.channel(
        arm, "rotation", [0.0, 1.5, 3.0], [turn((0, 0, 1), -20), turn((0.2, 0, 1), 100), turn((1, 0, 0), -160)]
    )
    file.channel(eye, "translation", [1.0, 2.0], [(0.25, 0.5, 0.0), (-0.5, 0.75, 1.0)])
    file.channel(eye, "rotation", [0.75, 3.25], [turn((0, 1, 0), -70), turn((1, 1, 0), 65)])
    return file


def trs_step():
    file = Glb()
    # Before the first key the first key counts, not what the node says.
    box = file.node("box", mesh=file.mesh("box", WEDGE, WEDGE_SIDES), translation=[9, 9, 9], scale=[3, 3, 3])
    lamp = file.node("lamp", mesh=file.mesh("lamp", [(x, y, 2 * z) for x, y, z in WEDGE], WEDGE_SIDES), parent=box)
    still = file.node("still", mesh=1, translation=[0, 0, 5], rotation=turn((0, 1, 0), 30))
    file.clip("jump")
    step = "STEP"
    file.channel(box, "translation", [1.0, 2.0, 3.5], [(1, 2, 3), (-1, 0.5, 0), (4, 0, -2)], step)
    file.channel(
        box, "rotation", [0.5, 2.5, 3.5], [turn((0, 1, 0), 90), turn((1, 0, 1), 200), turn((0.3, 1, 0), -45)], step
    )
    # A size of nothing is how files hide things.
    file.channel(box, "scale", [0.5, 1.5, 3.0], [(1, 1, 1), (0, 0, 0), (0.5, 2, 1)], step)
    file.channel(lamp, "translation", [1.75, 3.25], [(0, 1, 0), (0, -1, 0.5)], step)
    # One key: always there.
    file.channel(still, "translation", [2.0], [(-3, 1, 1)])
    return file


def trs_cubic():
    file = Glb()
    twice = (2.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    mast = file.node("mast", matrix=after(columns((1.0, -2.0, 0.5), turn((0, 1, 0), 40)), twice))
    buoy = file.node("buoy", mast, mesh=file.mesh("buoy", WEDGE, WEDGE_SIDES))
    chain = file.node("chain", buoy, mesh=file.mesh("chain", [(x, 2 * y, z) for x, y, z in WEDGE], WEDGE_SIDES))
    file.clip("swell")
    cubic = "CUBICSPLINE"
    # Every key is tangent in, value, tangent out.
    file.channel(
        buoy,
        "translation",
        [0.5, 1.25, 3.25],
        [
            *[(7, 7, 7), (0, 0, 0), (2.0, -1.0, 0.5)],
            *[(1.0, 3.0, -2.0), (1, 0.5, -0.5), (-4.0, 0.5, 1.0)],
            *[(0.5, -2.0, 1.5), (-1, 0.75, 2), (7, 7, 7)],
        ],
        cubic,
    )
    file.channel(
        buoy,
        "rotation",
        [0.0, 1.0, 2.5],
        [
            *[(5, 5, 5, 5), turn((0, 1, 0), -30), (0.2, 0.9, -0.3, 0.1)],
            *[(-0.4, 0.6, 0.3, -0.5), turn((0.5, 1, 0), 80), (0.8, -0.2, 0.4, -0.3)],
            *[(0.1, -0.7, 0.9, 0.2), turn((1, 0.2, 0.4), 140), (5, 5, 5, 5)],
        ],
        cubic,
    )
    file.channel(
        buoy,
        "scale",
        [1.0, 2.0],
        [
            *[(9, 9, 9), (1.0, 0.5, 1.5), (1.5, -0.5, 0.25)],
            *[(-1.0, 2.0, 0.5), (0.75, 1.25, 1.0), (9, 9, 9)],
        ],
        cubic,
    )
    file.channel(chain, "translation", [0.25, 3.0], [(0, -1, 0), (0.5, -2, 0.25)])
    return file


def skin4():
    file = Glb()
    vertices, triangles = bar(5, 0.75)
    # Place of every joint while the bar was bound: one above the other, each turned.
    bound = [columns((0.0, 0.9 * i, 0.05 * i), turn((0.2, 1, 0.4), 25 * i)) for i in range(4)]

    def placed(i):
        """Joint i below joint i - 1, as bound, for a file."""
        local = after(inverse(bound[i - 1]), bound[i])
        return {"translation": list(local[12:15]), "rotation": list(turn((0.2, 1, 0.4), 25))}

    stand = file.node("stand", translation=[1, 0, -2], rotation=turn((0.1, 1, 0), 30), scale=[1.5, 1.5, 1.5])
    a = file.node("joint_a", stand, translation=[0.0, 0.25, 0.0])
    b = file.node("joint_b", a, **placed(1))
    c = file.node("joint_c", b, **placed(2))
    d = file.node("joint_d", c, **placed(3))
    file.node("lamp", d, mesh=file.mesh("lamp", [(x / 2, y / 2 + 0.5, z) for x, y, z in WEDGE], WEDGE_SIDES))

    # Influences in one interleaved view; joints are not in the order of the chain.
    order, number = [1, 0, 3, 2], {0: 1, 1: 0, 2: 3, 3: 2}
    rows = bytearray()
    for x, y, z in vertices:
        weights = shares([math.exp(-((y / 0.9 - i + 0.1 * x) ** 2) * 0.5) for i in range(4)], 255)
        # The joint of a weight of nothing is 0.
        joints = [number[i] if weights[i] else 0 for i in range(4)]
        rows += struct.pack("<3f4B4B", x, y, z, *joints, *weights)
    view = file.view(rows, ARRAY_BUFFER, stride=20)

    def column(offset, kind, component, **more):
        what = {"bufferView": view, "byteOffset": offset, "componentType": component, "count": len(vertices)}
        return file.push("accessors", {**what, "type": kind, **more})

    corners = encode(vertices, FLOAT, False)
    bounds = {"min": [min(column) for column in zip(*corners)], "max": [max(column) for column in zip(*corners)]}
    attributes = {
        "POSITION": column(0, "VEC3", FLOAT, **bounds),
        "JOINTS_0": column(12, "VEC4", UBYTE),
        "WEIGHTS_0": column(16, "VEC4", UBYTE, normalized=True),
    }
    primitive = {"attributes": attributes, "indices": file.triangles(triangles)}
    mesh = file.push("meshes", {"name": "bar", "primitives": [primitive]})
    binds = file.accessor([inverse(bound[i]) for i in order], "MAT4")
    skin = file.push("skins", {"joints": [[a, b, c, d][i] for i in order], "inverseBindMatrices": binds})
    # The place of a skinned mesh counts for nothing.
    nowhere = {"translation": [5, -3, 2], "rotation": turn((1, 0, 0), 77), "scale": [2, 0.5, 1]}
    file.node("bar", stand, mesh=mesh, skin=skin, **nowhere)

    file.clip("bend")
    first = turn((0.2, 1, 0.4), 25)
    file.channel(a, "rotation", [0.5, 1.5, 3.0], [turn((0, 1, 0), 0), turn((0.3, 1, 0), 120), turn((0, 0, 1), -40)])
    file.channel(b, "rotation", [0.25, 1.5], [first, times(turn((1, 0, 0), 60), first)])
    file.channel(
        c, "rotation", [1.0, 2.0, 2.5], [first, minus(times(turn((0, 0, 1), 70), first)), turn((0, 1, 1), 110)]
    )
    file.channel(c, "scale", [0.5, 2.5], [(1, 1, 1), (1.4, 0.6, 0.9)])
    file.channel(d, "rotation", [0.5, 2.75], [first, turn((1, 0, 1), -100)])
    file.channel(d, "translation", [1.0, 2.0], [placed(3)["translation"], (0.1, 1.4, -0.2)])
    return file


def skin8():
    """Nine joints that move among 260: some numbers do not fit into eight bits."""
    file = Glb()
    vertices, triangles = bar(6, 0.8)
    numbers = [2, 17, 100, 200, 255, 256, 257, 258, 259]
    base = file.node("base", translation=[-1, 0.5, 0], rotation=turn((0, 0, 1), -15))
    chain, parent = [], base
    for i in range(9):
        place = {"translation": [0.0, 0.5 if i else 0.0, 0.0], "rotation": turn((1, 0, 0.5), 4 * i)}
        parent = file.node(f"b{i}", parent, **place)
        chain.append(parent)
    # The others stand far away, so that a mistaken number shows.
    joints = [chain[numbers.index(i)] if i in numbers else None for i in range(260)]
    for i in range(260):
        if joints[i] is None:
            joints[i] = file.node(f"r{i}", chain[0], translation=[50, i, 0])
    # Bound upright, unlike the places in the file.
    upright = (0.0, 0.0, 0.0, 1.0)
    binds = [columns((0.0, -0.5 * chain.index(j) if j in chain else 0.0, 0.0), upright) for j in joints]
    all_joints, all_weights = [[], []], [[], []]
    for vertex, (x, y, z) in enumerate(vertices):
        # Eight of the nine; every fourth vertex has fewer.
        chosen = [i for i in range(9) if i != vertex % 9]
        row = [0.05 + math.exp(-((y / 0.5 - i + x) ** 2) * 0.4) for i in chosen]
        if vertex % 4 == 0:
            row[5] = row[1] = 0.0
        row = shares(row, 65535)
        for half in range(2):
            part = slice(4 * half, 4 * half + 4)
            all_joints[half].append(tuple(numbers[i] if w else 0 for i, w in zip(chosen[part], row[part])))
            all_weights[half].append(tuple(w / 65535 for w in row[part]))
    more = {}
    for half in range(2):
        more[f"JOINTS_{half}"] = file.accessor(all_joints[half], "VEC4", USHORT, target=ARRAY_BUFFER)
        more[f"WEIGHTS_{half}"] = file.accessor(all_weights[half], "VEC4", USHORT, True, target=ARRAY_BUFFER)
    mesh = file.mesh("tail", vertices, triangles, **more)
    matrices = file.accessor(binds, "MAT4")
    skin = file.push("skins", {"joints": joints, "inverseBindMatrices": matrices, "skeleton": base})
    file.node("tail", mesh=mesh, skin=skin)
    file.clip("wag")
    for i, joint in enumerate(chain[1:], 1):
        axis = [(1, 0, 0.2), (0, 0.3, 1), (0.5, 1, 0)][i % 3]
        # Rotations as normalised integers; every third joint jumps.
        keys = [short_turn(axis, -15 - 5 * i), short_turn(axis, 25 + 6 * i), short_turn((0.1, 0, 1), 10 * i)]
        start = 0.25 + 0.125 * (i % 4)
        file.channel(joint, "rotation", [start, 1.25, 2.5], keys, ["STEP", "LINEAR", "LINEAR"][i % 3], SHORT)
    return file


def sheet(across, down):
    return grid(across, down, lambda i, j: (0.5 * i - 0.6, 0.1 * i * j, 0.5 * j - 0.4))


def morph():
    file = Glb()
    vertices, triangles = sheet(3, 3)
    bulge = file.positions([(0.1 * math.sin(i), 0.3 * math.cos(2 * i), 0.05 * i) for i in range(9)])
    pinch = file.sparse(9, {1: (0, 1.0, 0), 5: (-0.5, 0.25, 0.75), 8: (0.3, -0.8, 0)})
    mesh = file.mesh("sheet", vertices, triangles, [bulge, pinch])
    file.json["meshes"][mesh]["weights"] = [0.0, 0.5]
    sheet_node = file.node("sheet", mesh=mesh, weights=[0.25, 0.0], translation=[0, 1, 0], rotation=turn((1, 0, 0), 20))
    # The same mesh at its own weights, and at weights of the node.
    file.node("still", mesh=mesh, translation=[3, 0, 0])
    file.node("poised", mesh=mesh, weights=[0.75, 0.25], translation=[-3, 0, 0])
    file.clip("breathe")
    # Below 0 and above 1 too.
    file.channel(sheet_node, "weights", [0.5, 1.5, 2.0, 3.0], [(0.1, 0.0), (1.5, 0.5), (-0.25, 1.0), (0.5, 0.75)])
    return file


def morph_cubic():
    file = Glb()
    vertices, triangles = sheet(3, 3)
    lift = file.positions([(0.0, 0.2 * i, 0.1) for i in range(9)])
    base = [(0.05 * i, 0.0, -0.02 * i) for i in range(9)]
    skew = file.sparse(9, {0: (0.5, 0.5, 0.5), 8: (-0.25, 1.0, 0.0)}, base, UBYTE)
    mesh = file.mesh("sheet", vertices, triangles, [lift, skew])
    node = file.node("sheet", mesh=mesh, rotation=turn((0, 1, 0), 50))
    file.clip("wave")
    # Every key is all tangents in, all values, all tangents out.
    keys = [
        *[(8, 8), (0.25, 0.75), (0.5, -0.25)],
        *[(0.25, 0.75), (0.75, 0.25), (0.5, 0.5)],
        *[(-0.5, -0.75), (0.4, 0.9), (8, 8)],
    ]
    file.channel(node, "weights", [0.5, 1.5, 3.0], keys, "CUBICSPLINE")
    return file


def morph_skin():
    file = Glb()
    vertices, triangles = bar(4, 0.6)
    swell = file.positions([(0.6 * x, 0.1, 0.8 * z) for x, y, z in vertices])
    lean = file.sparse(16, {i: (0.3, 0.0, -0.2) for i in range(8, 16)})
    root = file.node("root", translation=[0, 0.5, 1], rotation=turn((0, 0, 1), 25))
    low = file.node("low", root)
    high = file.node("high", low, translation=[0, 0.9, 0], rotation=turn((1, 0, 0), 15))
    binds = file.accessor([columns((0, 0, 0), (0, 0, 0, 1)), columns((0, -0.9, 0), (0, 0, 0, 1))], "MAT4")
    skin = file.push("skins", {"joints": [low, high], "inverseBindMatrices": binds})
    share = [min(max(y - 0.4, 0.0), 1.0) for _, y, _ in vertices]
    more = {
        "JOINTS_0": file.accessor([(0, 1 if w else 0, 0, 0) for w in share], "VEC4", UBYTE, target=ARRAY_BUFFER),
        "WEIGHTS_0": file.accessor([(1 - w, w, 0, 0) for w in share], "VEC4", target=ARRAY_BUFFER),
    }
    mesh = file.mesh("muscle", vertices, triangles, [swell, lean], **more)
    node = file.node("muscle", mesh=mesh, skin=skin, scale=[2, 2, 2])
    file.clip("flex")
    file.channel(high, "rotation", [0.5, 1.5, 2.5], [turn((1, 0, 0), 15), turn((1, 0, 0.4), 115), turn((0, 1, 0), -60)])
    # Weights as normalised integers; the mesh moves and must not.
    file.channel(node, "weights", [0.25, 1.0, 2.0], [(0.0, 0.0), (1.0, 0.25), (0.4, 0.8)], component=USHORT)
    file.channel(node, "translation", [0.5, 2.0], [(0, 0, 0), (5, 5, 5)])
    return file


def two_clips():
    file = Glb()
    mesh = file.mesh("gate", WEDGE, WEDGE_SIDES)
    gate = file.node("gate", mesh=mesh, translation=[2, 0, 0], rotation=turn((0, 1, 0), 15))
    mesh = file.mesh("barrier", [(x, y, 3 * z) for x, y, z in WEDGE], WEDGE_SIDES)
    barrier = file.node("barrier", mesh=mesh, translation=[-2, 1, 0])
    file.clip("swing")
    file.channel(gate, "rotation", [0.5, 2.0], [turn((0, 1, 0), 15), turn((0, 1, 0.1), 95)])
    file.channel(gate, "scale", [0.5, 2.0], [(1, 1, 1), (1, 1.5, 0.75)])
    file.clip("lift")
    file.channel(barrier, "translation", [1.0, 3.0], [(-2, 1, 0), (-2, 4, 0.5)])
    return file


SCENES = [trs_linear, trs_step, trs_cubic, skin4, skin8, morph, morph_cubic, morph_skin, two_clips]

# The flag's samples in the MDD file lie unevenly; the PC2 file can only say where the first is and how far the next.
FLAG_TIMES = [0.5, 0.75, 1.0, 1.5, 2.25, 3.0]
FLAG_START, FLAG_RATE = 5.0, 2.5


def flag_at(time):
    """The 20 vertices in the axes of glTF: y is up, the mast is at x = 0."""

    def corner(i, j):
        x, y = 0.4 * i, 2.0 - 0.35 * j
        swing = 0.5 * x * math.sin(2.1 * x - 3.0 * time + 0.3 * j)
        return (x - 0.1 * x * abs(swing), y - 0.05 * i * time / 3, swing)

    vertices, triangles = grid(5, 4, corner)
    return encode(vertices, FLOAT, False), triangles


def flag():
    # The mesh at rest is no sample of the cache.
    vertices, triangles = flag_at(0.0)
    file = Glb()
    file.node("flag", mesh=file.mesh("flag", vertices, triangles))
    file.save(HERE / "flag.glb")
    obj("flag", "flag", vertices, triangles)
    samples = [value for time in FLAG_TIMES for vertex in flag_at(time)[0] for value in vertex]
    count = len(FLAG_TIMES)
    mdd = struct.pack(f">2i{count}f", count, len(vertices), *FLAG_TIMES) + struct.pack(f">{len(samples)}f", *samples)
    (HERE / "flag.mdd").write_bytes(mdd)
    pc2 = struct.pack("<12siiffi", b"POINTCACHE2\0", 1, len(vertices), FLAG_START, FLAG_RATE, count)
    (HERE / "flag.pc2").write_bytes(pc2 + struct.pack(f"<{len(samples)}f", *samples))


def water():
    """Four states of a surface, y up, each with its own number of triangles."""
    for number, cells in enumerate([2, 3, 5, 4], 1):
        def corner(i, j):
            x, z = 4.0 * i / cells - 2.0, 4.0 * j / cells - 2.0
            return (x, 0.3 * math.sin(1.5 * x + number) * math.cos(z), z)

        vertices, triangles = grid(cells + 1, cells + 1, corner)
        obj(f"water_{number:04}", "water", vertices, triangles)


def obj(stem, name, vertices, triangles):
    # Nine digits give a single precision number back.
    lines = [f"o {name}"]
    lines += ["v " + " ".join(f"{single(value):.9g}" for value in vertex) for vertex in vertices]
    lines += ["f " + " ".join(str(corner + 1) for corner in triangle) for triangle in triangles]
    (HERE / f"{stem}.obj").write_text("\n".join(lines) + "\n")


def write():
    for scene in SCENES:
        scene().save(HERE / f"{scene.__name__}.glb")
    flag()
    water()


if __name__ == "__main__":
    write()
