"""Evaluated meshes of Blender as arrays, and as meshes of echocast."""

from dataclasses import dataclass
from typing import Any

import echocast as ec
import numpy as np

from .materials import Read


class Unusable(Exception):
    """A mesh that cannot be scanned; its text says why."""


def vertices(mesh: Any) -> Any:
    """Positions of the vertices, n x 3, float32, in units of Blender."""
    places = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    # The attribute is copied as one piece of memory; Blender 3.4 has none.
    attribute = mesh.attributes.get("position")
    if attribute is not None:
        attribute.data.foreach_get("vector", places)
    else:
        mesh.vertices.foreach_get("co", places)
    return places.reshape(-1, 3)


def set_vertices(mesh: Any, places: Any) -> None:
    """Sets the positions of the vertices, n x 3, float32, in units of Blender."""
    # As above: one by one a million take a quarter of a second.
    attribute = mesh.attributes.get("position")
    if attribute is not None:
        attribute.data.foreach_set("vector", places.ravel())
    else:
        mesh.vertices.foreach_set("co", places.ravel())


def get(collection: Any, name: str, count: int, dtype: Any) -> Any:
    values = np.empty(count, dtype=dtype)
    collection.foreach_get(name, values)
    return values


@dataclass
class Triangles:
    """The triangles of a mesh."""

    #: m x 3
    vertices: Any
    #: Of each triangle; None: all are 0.
    materials: Any
    #: Texture coordinates of each corner, 3m x 2; None: no material has an image, or the mesh no UV map.
    uvs: Any
    #: Unit normals of each corner, 3m x 3; None: all faces are flat.
    normals: Any


def triangles(mesh: Any, read: "list[Read]") -> Triangles:
    """Reads the triangles of an evaluated mesh, whose slots have the materials `read`."""
    mesh.calc_loop_triangles()
    faces = mesh.loop_triangles
    count = len(faces)
    index = None
    if len(read) > 1:
        # Indices beyond the slots mean the last.
        index = np.minimum(get(faces, "material_index", count, np.int32), len(read) - 1)
        index = None if not index.any() else np.maximum(index, 0)
    corner_vertices = mesh.attributes.get(".corner_vert")
    smooth = is_smooth(mesh)
    needs_uvs = any(one.has_image for one in read) and len(mesh.uv_layers) > 0
    corners = None
    if corner_vertices is not None or needs_uvs:
        corners = get(faces, "loops", 3 * count, np.int32)
    if corner_vertices is not None:
        of_corner = get(corner_vertices.data, "value", len(mesh.loops), np.int32)
        indices = of_corner[corners]
    else:
        indices = get(faces, "vertices", 3 * count, np.int32)
    normals = None
    if smooth:
        if hasattr(mesh, "corner_normals"):
            normals = get(mesh.corner_normals, "vector", 3 * len(mesh.loops), np.float32).reshape(-1, 3)[corners]
        else:
            mesh.calc_normals_split()
            normals = get(faces, "split_normals", 9 * count, np.float32).reshape(-1, 3)
    uvs = coordinates(mesh, read, index, corners) if needs_uvs else None
    return Triangles(indices.reshape(-1, 3).astype(np.uint32), index, uvs, normals)


def is_smooth(mesh: Any) -> bool:
    if not len(mesh.polygons):
        return False
    if hasattr(mesh, "normals_domain"):
        return mesh.normals_domain != "FACE"
    # Blender 3.4 has an attribute for it per face.
    return bool(get(mesh.polygons, "use_smooth", len(mesh.polygons), bool).any()) or mesh.has_custom_normals


def has_map(mesh: Any, read: Read) -> bool:
    """Whether a mesh has the UV map of the image of a material, if that has any."""
    return not read.has_image or (read.uv_map in mesh.uv_layers if read.uv_map else len(mesh.uv_layers) > 0)


def coordinates(mesh: Any, read: "list[Read]", index: Any, corners: Any) -> Any:
    """Texture coordinates of the corners, of the UV map that the material of each triangle uses."""
    layers: "dict[str, Any]" = {}

    def layer(name: "str | None") -> Any:
        found = mesh.uv_layers.get(name) if name else None
        found = found or next((one for one in mesh.uv_layers if one.active_render), mesh.uv_layers[0])
        if found.name not in layers:
            if hasattr(found, "uv"):
                values = get(found.uv, "vector", 2 * len(mesh.loops), np.float32)
            else:
                values = get(found.data, "uv", 2 * len(mesh.loops), np.float32)
            layers[found.name] = np.nan_to_num(values).reshape(-1, 2)[corners]
        return layers[found.name]

    used = [(slot, layer(one.uv_map)) for slot, one in enumerate(read) if one.has_image]
    if index is None or len(layers) == 1:
        return used[0][1]
    uvs = np.zeros((len(corners), 2), dtype=np.float32)
    of_corner = np.repeat(index, 3)
    for slot, values in used:
        uvs[of_corner == slot] = values[of_corner == slot]
    return uvs


def mesh_of(name: str, mesh: Any, read: "list[Read]") -> "ec.Mesh | None":
    """The mesh of echocast; None if it has no triangle."""
    places = vertices(mesh)
    if not np.isfinite(places).all():
        raise Unusable("a vertex is not a number")
    found = triangles(mesh, read)
    if not len(found.vertices):
        return None
    normals = found.normals
    if normals is not None and not np.isfinite(normals).all():
        normals = None
    return ec.Mesh(
        places,
        found.vertices,
        name=name,
        materials=[one.material for one in read],
        material_index=None if found.materials is None else found.materials.astype(np.uint32),
        uvs=found.uvs,
        normals=normals,
    )
