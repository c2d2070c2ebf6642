from pathlib import Path

import numpy as np
import pytest

import echocast as ec


@pytest.fixture(scope="session")
def room() -> ec.Scene:
    """A floor of 18 x 18 m and a wall in front, of two categories."""
    vertices = np.array(
        [[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0], [6, -9, 0], [6, 9, 0], [6, 9, 4], [6, -9, 4]], dtype=np.float32
    )
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], dtype=np.uint32)
    categories = np.array([40, 40, 50, 50], dtype=np.uint32)
    return ec.Scene.from_arrays(vertices, triangles, categories=categories, names={40: "road", 50: "building"})


@pytest.fixture(scope="session")
def cloud(room: ec.Scene) -> ec.PointCloud:
    return room.scan("velodyne_vlp16", at=(0, 0, 1.8), seed=7)


@pytest.fixture
def tent(tmp_path: Path) -> Path:
    """The file of a tent, 2 x 2 m and 2 m high."""
    path = tmp_path / "tent.obj"
    path.write_text("o tent\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv 0 0 2\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n")
    return path
