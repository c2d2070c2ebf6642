"""Clouds: columns without copies, slices, files."""

import gc
import pickle
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import echocast as ec


def test_columns_share_the_memory_of_the_cloud(cloud: ec.PointCloud) -> None:
    a, b = cloud.range, cloud["range"]
    assert a.__array_interface__["data"][0] == b.__array_interface__["data"][0]
    assert not a.flags.writeable and not a.flags.owndata
    assert a.dtype == np.float32 and cloud.time.dtype == np.float64 and cloud.category_id.dtype == np.uint32
    with pytest.raises(ValueError):
        a[0] = 1


def test_a_column_keeps_its_cloud_alive(room: ec.Scene) -> None:
    column = room.scan("velodyne_vlp16", at=(0, 0, 1.8)).range
    before = column.copy()
    gc.collect()
    others = [room.scan("velodyne_vlp16", at=(1, 0, 1.8)) for _ in range(3)]
    assert np.array_equal(column, before) and len(others) == 3


def test_labels_and_positions_are_those_of_the_scene(cloud: ec.PointCloud) -> None:
    assert cloud.categories == {40: "road", 50: "building"}
    road = cloud[cloud.category_id == 40]
    assert len(road) == (cloud.category_id == 40).sum() > 1000
    assert abs(np.median(road.z) + cloud.origin[2]) < 0.03
    assert cloud.xyz.shape == (len(cloud), 3) and cloud.xyz.dtype == np.float32
    assert np.allclose(np.linalg.norm(cloud.xyz + cloud.origin - [0, 0, 1.8], axis=1), cloud.range, atol=0.05)


@pytest.mark.parametrize(
    "key", [
        slice(10, 20),
        slice(None, None, -7),
        slice(5, 0),
        slice(-3, None),
        np.array([3, -1, 3]),
        np.array([3, 7], dtype=np.uint8),
        np.array([], dtype=np.int64),
        [1, 2],
        [-1, 0],
        [],
    ],
)
def test_rows_are_those_that_numpy_takes(cloud: ec.PointCloud, key: Any) -> None:
    part = cloud[key]
    for name in cloud.fields:
        assert np.array_equal(part[name], cloud[name][key if isinstance(key, slice) else np.array(key, int)]), name
    assert part.categories == cloud.categories and part.fields == cloud.fields


def test_lists_of_bools_are_masks(cloud: ec.PointCloud) -> None:
    near = cloud.range < np.median(cloud.range)
    assert np.array_equal(cloud[near.tolist()].x, cloud.x[near]) and len(cloud[near.tolist()]) == near.sum() > 0


def test_what_is_not_there_is_told(cloud: ec.PointCloud) -> None:
    with pytest.raises(AttributeError, match="was not computed; ask for it with fields"):
        cloud.doppler
    with pytest.raises(AttributeError, match="no \"foo\""):
        cloud.foo  # type: ignore[attr-defined]
    with pytest.raises(KeyError, match="no column"):
        cloud["doppler"]
    with pytest.raises(ec.ArgumentError, match="mask is 3 long"):
        cloud[np.array([True, False, True])]
    with pytest.raises(ec.ArgumentError, match="row is"):
        cloud[np.array([len(cloud)])]
    assert "range" in dir(cloud) and "write" in dir(cloud)


def test_clouds_are_written_read_and_pickled(cloud: ec.PointCloud, tmp_path: Path) -> None:
    for name in ["a.npz", "a.las", "a.ply"]:
        cloud.write(tmp_path / name)
        again = ec.PointCloud.read(tmp_path / name)
        assert len(again) == len(cloud) and again.categories == cloud.categories
    copy = pickle.loads(pickle.dumps(cloud))
    assert all(np.array_equal(copy[name], cloud[name]) for name in cloud.fields)
    with pytest.raises(ec.UnsupportedError, match="clouds are written as"):
        cloud.write(tmp_path / "a.xyz")
    with pytest.raises(FileNotFoundError):
        ec.PointCloud.read(tmp_path / "missing.las")


def test_pictures_are_png(cloud: ec.PointCloud) -> None:
    assert cloud.png(width=400).startswith(b"\x89PNG") and cloud._repr_png_()
    with pytest.raises(ValueError, match="allowed"):
        cloud.png(view="sideways")


def test_the_same_bits_from_threads_that_share_a_scene(room: ec.Scene, cloud: ec.PointCloud) -> None:
    found: dict[int, ec.PointCloud] = {}

    def work(number: int) -> None:
        found[number] = room.scan("velodyne_vlp16", at=(0, 0, 1.8), seed=7)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4
    for other in found.values():
        assert all(np.array_equal(other[name], cloud[name], equal_nan=True) for name in cloud.fields)


def test_clouds_are_arrays_of_all_columns(cloud: ec.PointCloud) -> None:
    array = np.asarray(cloud)
    assert array.shape == (len(cloud),) and array.dtype.names == tuple(cloud.fields)
    assert all(np.array_equal(array[name], cloud[name]) for name in cloud.fields)
    with pytest.raises(ValueError, match="is a copy"):
        cloud.__array__(copy=False)
    assert cloud.to_dict()["range"].__array_interface__["data"] == cloud.range.__array_interface__["data"]


def test_clouds_are_data_frames(cloud: ec.PointCloud) -> None:
    pytest.importorskip("pandas")
    frame = cloud.to_pandas()
    assert list(frame.columns) == cloud.fields and frame.attrs["categories"][40] == "road"
    assert np.array_equal(frame["range"].to_numpy(), cloud.range)


def test_columns_are_given_to_other_libraries_by_dlpack(cloud: ec.PointCloud) -> None:
    given = np.from_dlpack(cloud.range)
    assert given.__array_interface__["data"] == cloud.range.__array_interface__["data"]
    torch = pytest.importorskip("torch")
    tensors = cloud.to_torch(["range", "category_id"])
    assert tensors["category_id"].dtype == torch.int64 and np.array_equal(tensors["range"].numpy(), cloud.range)


def test_a_loop_of_scans_keeps_its_memory(room: ec.Scene) -> None:
    resource = pytest.importorskip("resource")

    def peak() -> int:
        return int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)

    for number in range(50):
        room.scan("velodyne_vlp16", at=(0, 0, 1.8), seed=number)
    before = peak()
    for number in range(500):
        room.scan("velodyne_vlp16", at=(0, 0, 1.8), seed=number).range.sum()
    assert peak() - before < 30_000


def test_points_of_drivers_come_in_their_rows(room: ec.Scene) -> None:
    whole = room.scan("velodyne_vlp16", at=(0, 0, 1.8), organised=True)
    assert whole.organised is not None
    points, rings = whole.to_ros(), whole.ring.reshape(whole.organised)
    assert points.shape == rings.T.shape
    assert np.array_equal(points["ring"], np.sort(rings, axis=0).T)
    assert whole.to_ros("hesai").shape == rings.shape
    assert room.scan("velodyne_vlp16", at=(0, 0, 1.8)).to_ros().ndim == 1


def test_return_types_of_a_selection_are_those_of_all_or_none(room: ec.Scene) -> None:
    sensor = ec.Sensor("velodyne_vlp32c")
    sensor["returns.mode"] = "dual"
    cloud = room.scan(sensor, at=(0, 0, 1.8), fields="default,return_number,return_count", seed=7)
    types = cloud.to_ros("autoware")["return_type"]
    assert (cloud.return_count == 2).any() and set(np.unique(types)) - {0, 1}
    for rows in (cloud.range > 9, cloud.return_number == 2, slice(None, None, -1), np.random.default_rng(1).permutation(len(cloud))):
        found, right = cloud[rows].to_ros("autoware")["return_type"], types[rows]
        assert np.all((found == right) | (found == 0))
