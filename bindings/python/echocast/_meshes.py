"""Meshes of trimesh and Open3D as scenes. Neither package is imported: objects with the same attributes are accepted."""

import re
import sys
from collections.abc import Iterator, Mapping
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from echocast._arrays import check_type
from echocast._echocast import Scene
from echocast._errors import ArgumentError

Array = npt.NDArray[Any]
Triangles = npt.NDArray[np.uint32]
Matrix = npt.NDArray[np.float64]

if TYPE_CHECKING:
    from echocast._echocast import ObjectKeys

# Rotations to z up, by the axis that points up.
UP = {
    "z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    "y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    "-y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "x": [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
    "-x": [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
}


def scene(thing: Any, up: str = "z", scale: float = 1.0, category: str | int | None = None) -> Scene:
    """An echocast.Scene of `thing`: a trimesh.Trimesh or trimesh.Scene, an Open3D TriangleMesh, or a list of them.

    `up`: which of its axes points up; `scale`: metres per unit; `category`: the category of meshes that have no "category"
    in their metadata, by default their name without the number at its end.
    """
    check_type("up", up, str, ", ".join(UP))
    check_type("scale", scale, Real, "a number above 0")
    check_type("category", category, (str, Integral), "a name, or a number from 0 to 4294967295")
    if up not in UP:
        raise ArgumentError(f"up is {up!r}; allowed: {', '.join(UP)}")
    if not 0 < scale <= sys.float_info.max:
        raise ArgumentError(f"scale is {scale}; allowed: above 0")
    scale = float(scale)
    world = np.eye(4)
    world[:3, :3] = scale * np.array(UP[up])
    objects: "list[ObjectKeys]" = []
    for name, vertices, triangles, matrix, metadata in meshes(thing):
        objects.append({
            "name": name,
            "vertices": vertices,
            "triangles": triangles,
            "pose": world @ matrix,
            "category": label(metadata, category or re.sub(r"[ ._-]*\d+$", "", name) or name),
        })
    if not objects:
        raise ArgumentError("what a scene is to be made of has no mesh; allowed: at least one")
    return Scene.from_objects(objects)


def meshes(thing: Any) -> Iterator[tuple[str, Array, Triangles, Matrix, Mapping[str, Any]]]:
    """Yields name, vertices (n x 3), triangles (m x 3, uint32), the matrix to the axes of `thing` (4 x 4, float64) and
    the metadata of each mesh in it."""
    if isinstance(thing, (list, tuple)):
        for one in thing:
            yield from meshes(one)
    elif hasattr(thing, "graph") and hasattr(thing, "geometry"):
        for node in thing.graph.nodes_geometry:
            matrix, geometry = thing.graph[node]
            mesh = thing.geometry[geometry]
            # Points and lines have no faces.
            if hasattr(mesh, "faces"):
                yield str(node), *arrays(mesh.vertices, mesh.faces), np.asarray(matrix, np.float64), mesh.metadata
    elif hasattr(thing, "vertices") and hasattr(thing, "faces"):
        metadata = getattr(thing, "metadata", {})
        name = metadata.get("name") or metadata.get("file_name") or "mesh"
        yield str(name), *arrays(thing.vertices, thing.faces), np.eye(4), metadata
    elif hasattr(thing, "vertices") and hasattr(thing, "triangles"):
        yield "mesh", *arrays(thing.vertices, thing.triangles), np.eye(4), {}
    elif hasattr(thing, "vertex") and hasattr(thing, "triangle"):
        # Tensors, which may be on another device.
        vertices, triangles = thing.vertex["positions"].cpu().numpy(), thing.triangle["indices"].cpu().numpy()
        yield "mesh", *arrays(vertices, triangles), np.eye(4), {}
    else:
        allowed = "a trimesh.Trimesh or trimesh.Scene, an Open3D TriangleMesh, or a list of them"
        raise ArgumentError(f"what a scene is to be made of is of the type {type(thing).__name__}; allowed: {allowed}")


def arrays(vertices: Any, triangles: Any) -> tuple[Array, Triangles]:
    """Vertices as they are, and triangles as uint32."""
    vertices, triangles = np.asarray(vertices), np.asarray(triangles)
    if triangles.size and not 0 <= triangles.min() <= triangles.max() < len(vertices):
        found = f"a triangle has the vertices {triangles.min()} to {triangles.max()}"
        raise ArgumentError(f"{found}; allowed: 0 to {len(vertices) - 1}")
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3).astype(np.uint32)


def label(metadata: Mapping[str, Any], other: str | int) -> str | int:
    """The category given in `metadata`, a name or a number, or else `other`."""
    found = metadata.get("category", other)
    return found if isinstance(found, str) else int(found)
