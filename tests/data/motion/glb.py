"""Writes small GLB files: accessors into one buffer, and the container around it."""

import json
import struct

BYTE, UBYTE, SHORT, USHORT, UINT, FLOAT = 5120, 5121, 5122, 5123, 5125, 5126
LETTER = {BYTE: "b", UBYTE: "B", SHORT: "h", USHORT: "H", UINT: "I", FLOAT: "f"}
LARGEST = {BYTE: 127, UBYTE: 255, SHORT: 32767, USHORT: 65535}
WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963


def single(value):
    """`value` as it is after a trip through single precision."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


class Glb:
    """A file in the making; `json` can be filled by hand."""

    def __init__(self):
        self.bytes = bytearray()
        self.json = {
            "asset": {"version": "2.0", "generator": "echocast tests/data/motion"},
            "scene": 0,
            "scenes": [{"nodes": []}],
        }

    def push(self, kind, thing):
        """Appends to a top level array and says where."""
        things = self.json.setdefault(kind, [])
        things.append(thing)
        return len(things) - 1

    def view(self, data, target=None, stride=None):
        self.bytes += b"\0" * (-len(self.bytes) % 4)
        view = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        if stride is not None:
            view["byteStride"] = stride
        self.bytes += data
        return self.push("bufferViews", view)

    def accessor(self, rows, kind, component=FLOAT, normalized=False, target=None, bounds=False):
        """`rows` are tuples; normalised integers are given as what they stand for."""
        rows = encode(rows, component, normalized)
        assert all(len(row) == WIDTH[kind] for row in rows)
        data = bytearray()
        size = struct.calcsize(LETTER[component]) * WIDTH[kind]
        # What vertices refer to is aligned to four bytes.
        stride = size + -size % 4 if target == ARRAY_BUFFER else size
        for row in rows:
            data += struct.pack("<" + LETTER[component] * len(row), *row).ljust(stride, b"\0")
        accessor = {
            "bufferView": self.view(data, target, stride if stride != size else None),
            "componentType": component,
            "count": len(rows),
            "type": kind,
        }
        if normalized:
            accessor["normalized"] = True
        if bounds:
            add_bounds(accessor, rows)
        return self.push("accessors", accessor)

    def sparse(self, count, changed, base=None, indices=USHORT):
        """VEC3 accessor: `base`, else zeros without a buffer view, with `changed` rows {index: row} on top."""
        where, rows = sorted(changed), [changed[index] for index in sorted(changed)]
        accessor = {"componentType": FLOAT, "count": count, "type": "VEC3"}
        if base is not None:
            accessor["bufferView"] = self.view(b"".join(struct.pack("<3f", *row) for row in base), ARRAY_BUFFER)
        accessor["sparse"] = {
            "count": len(where),
            "indices": {
                "bufferView": self.view(struct.pack(f"<{len(where)}{LETTER[indices]}", *where)),
                "componentType": indices,
            },
            "values": {"bufferView": self.view(b"".join(struct.pack("<3f", *row) for row in rows))},
        }
        whole = [list(row) for row in (base or [(0.0, 0.0, 0.0)] * count)]
        for index, row in changed.items():
            whole[index] = row
        add_bounds(accessor, encode(whole, FLOAT, False))
        return self.push("accessors", accessor)

    def positions(self, rows):
        """Positions of vertices, or what a morph target adds to them."""
        return self.accessor(rows, "VEC3", target=ARRAY_BUFFER, bounds=True)

    def triangles(self, triangles):
        return self.accessor(
            [(corner,) for triangle in triangles for corner in triangle], "SCALAR", USHORT, target=ELEMENT_ARRAY_BUFFER
        )

    def mesh(self, name, vertices, triangles, targets=(), **more):
        """A mesh of one primitive with positions and triangles; `more` are further attributes."""
        primitive = {
            "attributes": {"POSITION": self.positions(vertices), **more},
            "indices": self.triangles(triangles),
        }
        if targets:
            primitive["targets"] = [{"POSITION": target} for target in targets]
        return self.push("meshes", {"name": name, "primitives": [primitive]})

    def node(self, name, parent=None, **more):
        node = self.push("nodes", {"name": name, **more})
        if parent is None:
            self.json["scenes"][0]["nodes"].append(node)
        else:
            self.json["nodes"][parent].setdefault("children", []).append(node)
        return node

    def clip(self, name):
        self.push("animations", {"name": name, "channels": [], "samplers": []})

    def channel(self, node, path, times, rows, interpolation="LINEAR", component=FLOAT):
        """A channel of the last clip. Rows of weights are one per key, as long as there are targets."""
        clip = self.json["animations"][-1]
        if path == "weights":
            rows = [(weight,) for row in rows for weight in row]
        kind = {"weights": "SCALAR", "rotation": "VEC4"}.get(path, "VEC3")
        sampler = {
            "input": self.accessor([(time,) for time in times], "SCALAR", bounds=True),
            "output": self.accessor(rows, kind, component, normalized=component != FLOAT),
        }
        # LINEAR is what is meant without a word.
        if interpolation != "LINEAR":
            sampler["interpolation"] = interpolation
        clip["samplers"].append(sampler)
        target = {"node": node, "path": path}
        clip["channels"].append({"sampler": len(clip["samplers"]) - 1, "target": target})

    def save(self, path):
        self.bytes += b"\0" * (-len(self.bytes) % 4)
        self.json["buffers"] = [{"byteLength": len(self.bytes)}]
        text = json.dumps(self.json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self.bytes), b"BIN\0") + self.bytes
        data = struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
        assert len(data) < 40_000, f"{path.name}: {len(data)} bytes"
        path.write_bytes(data)


def encode(rows, component, normalized):
    if component == FLOAT:
        return [tuple(single(value) for value in row) for row in rows]
    if normalized:
        return [tuple(round(value * LARGEST[component]) for value in row) for row in rows]
    return [tuple(row) for row in rows]


def add_bounds(accessor, rows):
    accessor["min"] = [min(column) for column in zip(*rows)]
    accessor["max"] = [max(column) for column in zip(*rows)]
