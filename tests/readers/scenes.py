"""Reads generated scenes, binary glTF, with readers that have nothing to do with echocast and prints them as JSON.

usage: scenes.py FILE...

One list element per file: name, category and number of instances of each node that shows a mesh, the triangles of all
instances, and whether all vertices are numbers.
"""

import json
import struct
import sys
from pathlib import Path

import numpy
import trimesh


def tree(path):
    """The first chunk of the file."""
    data = Path(path).read_bytes()
    magic, version, length, size, kind = struct.unpack_from("<4sIII4s", data)
    assert (magic, version, length, kind) == (b"glTF", 2, len(data), b"JSON"), path
    return json.loads(data[20 : 20 + size])


def instances(extensions, accessors):
    """How often a node shows its mesh; trimesh shows it once."""
    places = extensions.get("EXT_mesh_gpu_instancing")
    return accessors[places["attributes"]["TRANSLATION"]]["count"] if places else 1


def category(number, nodes, parents):
    """What the node is: as it says, or the nearest above it."""
    said = nodes[number].get("extras", {}).get("categoryID")
    return said or category(parents[number], nodes, parents)


def read(path):
    file = tree(path)
    accessors, nodes = file["accessors"], file["nodes"]
    parents = {child: number for number, node in enumerate(nodes) for child in node.get("children", [])}
    objects = [
        [node["name"], category(number, nodes, parents), instances(node.get("extensions", {}), accessors)]
        for number, node in enumerate(nodes)
        if "mesh" in node
    ]
    scene = trimesh.load_scene(path, process=False)
    triangles = 0
    for node in scene.graph.nodes_geometry:
        kept = scene.graph.transforms.edge_data[scene.graph.transforms.parents[node], node].get("metadata", {})
        mesh = scene.geometry[scene.graph[node][1]]
        triangles += len(mesh.faces) * instances(kept.get("gltf_extensions", {}), accessors)
    finite = all(numpy.isfinite(mesh.vertices).all() for mesh in scene.geometry.values())
    return {"objects": objects, "triangles": triangles, "finite": bool(finite)}


json.dump([read(path) for path in sys.argv[1:]], sys.stdout)
