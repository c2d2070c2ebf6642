"""Writes a scene, binary glTF, in other formats, with writers that have nothing to do with echocast.

usage: meshes.py SCENE.glb FOLDER

All is one mesh, y up, in metres; only binary.stl is in millimetres.
"""

import sys
from pathlib import Path

import numpy
import plyfile
import trimesh

mesh = trimesh.load_scene(sys.argv[1]).to_mesh()
folder = Path(sys.argv[2])
(folder / "text.ply").write_bytes(mesh.export(file_type="ply", encoding="ascii"))
(folder / "binary.ply").write_bytes(mesh.export(file_type="ply"))
(folder / "text.stl").write_text(mesh.export(file_type="stl_ascii"))
(folder / "scene.obj").write_text(mesh.export(file_type="obj", include_texture=False))

vertices = numpy.array([tuple(vertex) for vertex in mesh.vertices], dtype=[(axis, "f8") for axis in "xyz"])
faces = numpy.empty(len(mesh.faces), dtype=[("flags", "u1"), ("vertex_index", "i4", (3,))])
faces["vertex_index"] = mesh.faces
elements = [plyfile.PlyElement.describe(vertices, "vertex"), plyfile.PlyElement.describe(faces, "face")]
plyfile.PlyData(elements, byte_order=">").write(folder / "big.ply")

mesh.apply_scale(1000)
(folder / "binary.stl").write_bytes(mesh.export(file_type="stl"))
