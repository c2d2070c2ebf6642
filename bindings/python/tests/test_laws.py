"""Laws that hold for any array, slice and mask."""

import faulthandler
import operator
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import echocast as ec

faulthandler.enable()
settings.register_profile("quick", deadline=None, max_examples=60)
settings.load_profile("quick")

#: What somebody may pass for an array.
ANYTHING = st.one_of(
    st.none(),
    st.text(max_size=5),
    st.integers(),
    st.floats(),
    arrays.arrays(
        dtype=st.one_of(
            arrays.floating_dtypes(), arrays.integer_dtypes(), arrays.boolean_dtypes(), arrays.complex_number_dtypes()
        ),
        shape=arrays.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=6),
    ),
)
VERTICES = arrays.arrays(
    np.float32,
    st.tuples(st.integers(0, 8), st.just(3)),
    elements=st.floats(width=32) | st.floats(-10, 10, width=32),
)
TRIANGLES = arrays.arrays(np.uint32, st.tuples(st.integers(0, 6), st.just(3)), elements=st.integers(0, 9))


def equal(part: ec.PointCloud, cloud: ec.PointCloud, key: Any) -> bool:
    return all(np.array_equal(part[name], cloud[name][key], equal_nan=True) for name in cloud.fields)


@given(st.slices(40))
def test_slices_are_those_of_numpy(cloud: ec.PointCloud, key: slice) -> None:
    few = cloud[:40]
    assert equal(few[key], few, key)


@given(arrays.arrays(bool, 40))
def test_masks_are_those_of_numpy(cloud: ec.PointCloud, mask: npt.NDArray[np.bool_]) -> None:
    few = cloud[100:140]
    assert equal(few[mask], few, mask) and len(few[mask]) == mask.sum()


@given(arrays.arrays(np.int64, st.integers(0, 30), elements=st.integers(-40, 39)))
def test_row_numbers_are_those_of_numpy(cloud: ec.PointCloud, rows: npt.NDArray[np.int64]) -> None:
    few = cloud[:40]
    assert equal(few[rows], few, rows)


@given(VERTICES, TRIANGLES)
def test_meshes_are_made_or_refused(vertices: npt.NDArray[np.float32], triangles: npt.NDArray[np.uint32]) -> None:
    try:
        scene = ec.Scene.from_arrays(vertices, triangles)
        assert scene.triangles == len(triangles)
        assert len(scene.scan("velodyne_vlp16", at=(0, 0, 0.5), fields="x,y,z,range")) <= ec.Sensor("velodyne_vlp16").beams
    except ec.Error as error:
        assert str(error)


def few(thing: Any) -> Any:
    """Whole numbers become small: so many pings would be made, and thousands take all memory."""
    try:
        return operator.index(thing) % 9
    except TypeError:
        return thing


# Each example makes all calls.
@settings(max_examples=10)
@given(st.data())
def test_wrong_arguments_are_told(room: ec.Scene, cloud: ec.PointCloud, data: st.DataObject) -> None:
    """Whatever is passed for an array, a number or a name: an exception, or what it means."""
    thing, other = data.draw(ANYTHING), data.draw(ANYTHING)
    live = ec.LiveScene()
    calls: list[Callable[[], object]] = [
        lambda: ec.Scene.from_arrays(thing, other),
        lambda: ec.Scene.from_arrays(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.uint32), categories=thing),
        lambda: ec.Scene.from_objects([dict(vertices=thing, triangles=other, pose=thing)]),
        lambda: ec.Trajectory(thing, other),
        lambda: ec.Trajectory([0.0, 1.0], thing, other),
        lambda: ec.Pose(thing, quaternion=other),
        lambda: cloud[thing],
        lambda: live.add(thing, other),
        lambda: live.add(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.uint32), pose=thing),
        lambda: live.set_pose(thing, other),
        lambda: live.set_motion(0, [0.0], thing),
        lambda: live.set_vertex_motion(0, thing, other),
        lambda: live.remove(thing),
        lambda: room.camera(thing),
        lambda: cloud.image(thing, other),
        lambda: ec.Sensor(thing),
        lambda: ec.Environment(thing),
        lambda: room.scan("velodyne_vlp16", at=thing, seed=other),
        lambda: room.scan("velodyne_vlp16", fields=thing),
        lambda: room.scan("velodyne_vlp16", environment=thing),
        lambda: room.pings("sss_450", few(thing)),
        lambda: cloud.png(width=thing),
        lambda: ec.Scenario(thing),
    ]
    for call in calls:
        try:
            call()
        except (ec.Error, TypeError, ValueError, KeyError, IndexError, OverflowError, OSError) as error:
            assert str(error) or isinstance(error, (KeyError, OSError))


def test_huge_row_numbers_and_counts_are_told(room: ec.Scene, cloud: ec.PointCloud) -> None:
    for rows in [2**62, -(2**62)]:
        with pytest.raises(ec.ArgumentError):
            cloud[np.array([rows])]
    wide: list[tuple[Any, str]] = [
        (dict(seed=2**70), f"seed is {2**70}; allowed: 0 to {2**64 - 1}"),
        (dict(seed=-1), f"seed is -1; allowed: 0 to {2**64 - 1}"),
        (dict(frame=2**32), f"frame is {2**32}; allowed: 0 to {2**32 - 1}"),
        (dict(mask=-(2**70)), f"mask is {-(2**70)}; allowed: 0 to {2**32 - 1}"),
        (dict(specular_depth=256), "specular_depth is 256; allowed: 0 to 255"),
        (dict(frame_period=1.1e9), "frame_period is 1100000000; allowed: above 0, up to 1e9 s"),
    ]
    for options, told in wide:
        with pytest.raises(ec.ArgumentError, match=f"^{re.escape(told)}$"):
            room.scan("velodyne_vlp16", **options)
    most: Any = dict(seed=2**64 - 1, frame=2**32 - 1, mask=2**32 - 1, specular_depth=255, frame_period=1e9)
    assert len(room.scan("velodyne_vlp16", at=(0, 0, 1.8), **most)) > 1000
    with pytest.raises(TypeError):
        room.scan("velodyne_vlp16", seed=1.5)  # type: ignore[arg-type]
    with pytest.raises(ec.ArgumentError, match="count is -1; allowed: 0 to 4294967295"):
        room.pings("sss_450", -1)
    assert len(room.pings("sss_450", 0, at=(0, 0, -1))) == 0
    with pytest.raises(ec.ArgumentError, match="count is 4000000000; allowed: 0 to [0-9]+, for the memory"):
        room.pings("sss_450", 4_000_000_000, at=(0, 0, -1))
