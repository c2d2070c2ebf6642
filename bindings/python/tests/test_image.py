"""Images of cameras, boxes and annotations."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import echocast as ec

CAMERA = {
    "name": "camera",
    "kind": "tof",
    "pattern": {"type": "pinhole", "resolution": [64, 48], "fov_deg": [60, 45]},
    "range": {"min_m": 0.1, "max_m": 30},
}
FIELDS = "default,depth,beam,normal_x,normal_y,normal_z,red,green,blue"


@pytest.fixture(scope="module")
def seen(room: ec.Scene) -> ec.PointCloud:
    return room.scan(CAMERA, at=(0, 0, 1.8), fields=FIELDS, organised=True, boxes=True, image_boxes=True)


def test_layers_are_images(seen: ec.PointCloud) -> None:
    depth = seen.image("depth", CAMERA)
    assert depth.shape == (48, 64) and depth.dtype == np.float32
    # The wall is 6 m ahead.
    assert abs(np.nanmedian(depth[:20]) - 6) < 0.1
    assert (seen.image("category", CAMERA)[6:15] == 50).all()
    normal = seen.image("normal", CAMERA)
    assert normal.shape == (48, 64, 3) and np.allclose(np.linalg.norm(normal[10, 32]), 1, atol=1e-5)
    assert np.allclose(normal[5, 32], [0, 0, 1], atol=1e-5)
    with pytest.raises(ValueError, match="allowed"):
        seen.image("dept", CAMERA)  # type: ignore[arg-type]
    with pytest.raises(ec.UnsupportedError, match="rows and columns"):
        seen.image("depth", "livox_mid40")
    with pytest.raises(ec.Error):
        seen.image("depth", {**CAMERA, "pattern": {"type": "pinhole", "resolution": [8, 6], "fov_deg": [60, 45]}})


def test_layers_of_one_column_share_the_memory_of_organised_clouds(seen: ec.PointCloud) -> None:
    def address(array: npt.NDArray[Any]) -> int:
        return int(array.__array_interface__["data"][0])

    assert address(seen.image("depth", CAMERA)) == address(seen.depth)
    assert address(seen.image("instance", CAMERA)) == address(seen.instance_id)
    assert not seen.image("depth", CAMERA).flags.writeable


def test_annotations_tell_of_what_is_seen(seen: ec.PointCloud) -> None:
    wall = {found["category_id"]: found for found in seen.annotations(CAMERA)}[50]
    mask = seen.image("category", CAMERA) == 50
    assert wall["area"] == mask.sum()
    assert wall["truncation"] is not None and wall["occlusion"] is not None
    assert wall["bounds"][2] == 64 and wall["truncation"] > 0 and 0 <= wall["occlusion"] < 0.5


def test_boxes_are_around_objects(room: ec.Scene, seen: ec.PointCloud) -> None:
    assert room.scan("velodyne_vlp16", at=(0, 0, 1.8)).boxes is None
    wall = next(box for box in seen.boxes or [] if box.category == "building")
    assert np.allclose(wall.center, [6, 0, 2], atol=1e-3)
    assert np.allclose(sorted(wall.size), [0, 4, 18], atol=1e-3)
    assert wall.points == (seen.instance_id == wall.instance_id).sum() and wall.category_id == 50
    assert np.asarray(wall.corners).shape == (8, 3) and wall.velocity == [0, 0, 0] and wall.visible > 0.9
    assert wall.image is not None and wall.image[0] <= 0 and "building" in repr(wall)
