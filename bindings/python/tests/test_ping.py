"""Pings of sonars and their images."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import echocast as ec


@pytest.fixture(scope="module")
def bed() -> ec.Scene:
    vertices = np.array([[-60, -60, -30], [60, -60, -30], [60, 60, -30], [-60, 60, -30]], dtype=np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)
    return ec.Scene.from_objects([dict(name="bed", vertices=vertices, triangles=triangles, category="seabed")])


@pytest.fixture(scope="module")
def swath(bed: ec.Scene) -> ec.Ping:
    return bed.ping("mbes_400", at=(0, 0, -10), seed=1, fields="intensity,category_id", environment={"water": {}})


def test_a_ping_is_beams_by_bins(swath: ec.Ping) -> None:
    assert swath.levels.shape == (len(swath.axes), len(swath.ranges)) and swath.levels.dtype == np.float32
    assert not swath.levels.flags.writeable and swath["category_id"].shape == swath.levels.shape
    assert swath.levels.__array_interface__["data"] == swath["intensity"].__array_interface__["data"]
    assert swath.categories == {1: "seabed"} and swath.view == "swath" and swath.number == 0
    middle = swath.levels[len(swath.axes) // 2]
    assert abs(swath.ranges[middle.argmax()] - 20) < 0.3
    assert swath.threshold_db.shape == swath.ranges.shape and 1400 < swath.sound_speed < 1600
    with pytest.raises(KeyError, match="no column"):
        swath["range"]


def test_soundings_are_the_depth(swath: ec.Ping) -> None:
    found = swath.soundings
    near = np.abs(swath.axes[found["beam"], 1] + np.pi / 2) < 0.5
    depth = -found["range"] * np.sin(swath.axes[found["beam"], 1])
    assert near.sum() > 20 and abs(np.median(depth[near]) - 20) < 0.2
    assert (found["quality"] <= 1).all() and (found["bin"] < len(swath.ranges)).all()


def test_pings_are_those_of_one_after_another(bed: ec.Scene, tmp_path: Path) -> None:
    path = ec.Trajectory([0.0, 60.0], np.array([[-30.0, 0, -20], [30, 0, -20]]))
    options: dict[str, Any] = dict(at=path, seed=3, fields="intensity,category_id", environment={"water": {}})
    told: list[float] = []
    pings = bed.pings("sss_450", 5, progress=told.append, **options)
    assert len(pings) == 5 and [ping.number for ping in pings] == [0, 1, 2, 3, 4] and told == [0.2, 0.4, 0.6, 0.8, 1]
    period = ec.Sensor("sss_450").period
    alone = bed.ping("sss_450", **options, frame=2, start_time=2 * period)
    assert np.array_equal(pings[2].levels, alone.levels) and pings[-1].number == 4
    assert pings[2].pose.position[0] > pings[1].pose.position[0]
    image = pings.waterfall()
    assert image.kind == "waterfall" and image.values.shape == (5, 2 * len(pings.ranges))
    assert image["category_id"].max() == 1 and image.axes[1].startswith("ping")
    assert image.write(tmp_path / "waterfall.png") == [] and (tmp_path / "waterfall.png").exists()
    pings.write(tmp_path / "pings.npz")
    assert np.array_equal(np.load(tmp_path / "pings.npz")["level"][2], alone.levels)
    assert pings.png(width=400).startswith(b"\x89PNG")
    with pytest.raises(IndexError):
        pings[5]
    with pytest.raises(ec.Error):
        pings.depth_map(0.5)
    with pytest.raises(ec.CancelledError):
        bed.pings("sss_450", 5, progress=lambda done: done < 0.5, **options)
    with pytest.raises(ec.Error, match="sonar"):
        bed.ping("velodyne_vlp16")


def test_images_of_swaths(bed: ec.Scene, swath: ec.Ping, tmp_path: Path) -> None:
    fan = swath.fan(200)
    assert max(fan.values.shape) == 200 and np.isfinite(fan.values).any()
    path = ec.Trajectory([0.0, 10.0], np.array([[-5.0, 0, -10], [5, 0, -10]]))
    pings = bed.pings("mbes_400", 4, at=path, environment={"water": {}}, fields="intensity")
    depths = pings.depth_map(2.0)
    assert depths.kind == "depth_map" and abs(np.nanmedian(depths.values) + 30) < 0.3
