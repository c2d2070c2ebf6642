"""Scenes of the meshes of other packages."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import echocast as ec

SQUARE = np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]], dtype=np.float64)
TWO = np.array([[0, 1, 2], [0, 2, 3]])


def where(scene: ec.Scene, at: tuple[float, float, float] = (0, 0, 0)) -> dict[str, float]:
    """How far before `at` what is called so is, by category, m."""
    cloud = scene.scan("velodyne_vlp16", at=at, seed=1)
    x = cloud.x.astype(np.float64) + cloud.origin[0] - at[0]
    found = {name: np.median(x[cloud.category_id == number]) for number, name in cloud.categories.items()}
    return {name: round(float(place), 1) for name, place in found.items()}


def at(x: float, y: float = 0.0, z: float = 0.0) -> npt.NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3, 3] = [x, y, z]
    return matrix


def test_meshes_of_trimesh() -> None:
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box((1, 1, 1))
    box.apply_translation((5, 0, 0))
    scene = ec.Scene.from_mesh(box)
    assert scene.triangles == 12 and where(scene) == {"mesh": 4.5}
    box.metadata["category"] = "crate"
    assert where(ec.Scene.from_mesh(box, scale=2.0)) == {"crate": 9.0}
    box.metadata.clear()
    assert where(ec.Scene.from_mesh(box, category="thing")) == {"thing": 4.5}


def test_scenes_of_trimesh_have_objects() -> None:
    trimesh = pytest.importorskip("trimesh")
    made = trimesh.Scene()
    car = trimesh.Trimesh(SQUARE, TWO, process=False)
    wall = trimesh.Trimesh(SQUARE, TWO, process=False, metadata={"category": "wall"})
    made.add_geometry(car, node_name="Car_01", geom_name="car", transform=at(4, -2))
    made.add_geometry(car, node_name="Car_02", geom_name="car", transform=at(4, 2))
    made.add_geometry(wall, node_name="back", geom_name="wall", transform=at(7))
    made.add_geometry(trimesh.PointCloud(SQUARE), node_name="points")
    scene = ec.Scene.from_mesh(made)
    assert sorted(scene.objects) == ["Car_01", "Car_02", "back"] and where(scene) == {"Car": 4.0, "wall": 7.0}


@pytest.mark.parametrize("up", ["x", "-x", "y", "-y", "z", "-z"])
def test_axes_are_those_of_files(up: Any, tmp_path: Path) -> None:
    shape = SimpleNamespace(vertices=np.array([[3.0, 1, 2], [4, 1, 2], [3, 3, 5]]), faces=np.array([[0, 1, 2]]))
    lines = ["v {} {} {}".format(*vertex) for vertex in shape.vertices]
    (tmp_path / "a.obj").write_text("\n".join(["o a", *lines, "f 1 2 3\n"]))
    file, made = ec.Scene.load(tmp_path / "a.obj", up=up, scale=0.5), ec.Scene.from_mesh(shape, up=up, scale=0.5)
    assert made.bounds is not None and file.bounds is not None and np.allclose(made.bounds, file.bounds)


def test_meshes_of_open3d() -> None:
    """Both kinds, as far as they are read: Open3D itself is large."""

    class Tensor:
        def __init__(self, array: npt.NDArray[Any]) -> None:
            self.array = array

        def cpu(self) -> "Tensor":
            return self

        def numpy(self) -> npt.NDArray[Any]:
            return self.array

    legacy = SimpleNamespace(vertices=(SQUARE + [4, 0, 0]).tolist(), triangles=TWO.tolist())
    tensors = SimpleNamespace(
        vertex={"positions": Tensor(np.float32(SQUARE + [6, 3, 0]))}, triangle={"indices": Tensor(TWO.astype(np.int64))}
    )
    assert where(ec.Scene.from_mesh(legacy)) == {"mesh": 4.0} and where(ec.Scene.from_mesh(tensors)) == {"mesh": 6.0}
    assert len(ec.Scene.from_mesh([legacy, tensors]).objects) == 2


def test_meshes_of_the_real_open3d() -> None:
    o3d = pytest.importorskip("open3d")
    box = o3d.geometry.TriangleMesh.create_box(1, 2, 2).translate((5, -1, -1))
    assert where(ec.Scene.from_mesh(box)) == {"mesh": 5.0}
    assert where(ec.Scene.from_mesh(o3d.t.geometry.TriangleMesh.from_legacy(box))) == {"mesh": 5.0}


def test_survey_coordinates_keep_their_precision() -> None:
    far = np.array([4_500_000.0, 5_600_000.0, 100.0])
    square = SimpleNamespace(vertices=SQUARE + far + [5.3, 0, 0], faces=TWO)
    assert where(ec.Scene.from_mesh(square), at=tuple(far)) == {"mesh": 5.3}


def test_what_is_wrong_is_told() -> None:
    square = SimpleNamespace(vertices=SQUARE, faces=TWO)
    cases: list[tuple[Any, dict[str, Any], str]] = [
        ("car.glb", {}, "of the type str; allowed: a trimesh.Trimesh"),
        ([], {}, "has no mesh"),
        (square, {"up": "w"}, "up is 'w'; allowed: z, -z"),
        (square, {"scale": 0}, "scale is 0"),
        (SimpleNamespace(vertices=SQUARE, faces=TWO - 1), {}, "vertices -1 to 2; allowed: 0 to 3"),
    ]
    for thing, options, match in cases:
        with pytest.raises(ec.ArgumentError, match=match):
            ec.Scene.from_mesh(thing, **options)
