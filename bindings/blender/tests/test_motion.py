"""Frames and what moves within them, against closed forms."""

import math
from typing import Any

import bpy
import echocast as ec
import numpy as np
import pytest

from echocast_blender import scan, scene


@pytest.fixture(autouse=True)
def rate(empty_scene: None) -> None:
    """25 frames a second."""
    timeline = bpy.context.scene
    timeline.render.fps, timeline.frame_start, timeline.frame_end = 25, 1, 3


def straighten() -> None:
    """Straight lines between all keys."""
    for action in bpy.data.actions:
        layers = getattr(action, "layers", None)
        if layers:
            curves = [curve for layer in layers for strip in layer.strips for bag in strip.channelbags for curve in bag.fcurves]
        else:
            curves = list(action.fcurves)
        for curve in curves:
            for key in curve.keyframe_points:
                key.interpolation = "LINEAR"


def moving_wall(speed: float) -> Any:
    """A wall 10 m ahead that moves away from frame 0 on, m/s."""
    bpy.ops.mesh.primitive_plane_add(size=400, rotation=(0, math.pi / 2, 0), location=(10, 0, 0))
    wall = bpy.context.object
    wall.keyframe_insert("location", frame=0)
    wall.location.x = 10 + 100 * speed / 25
    wall.keyframe_insert("location", frame=100)
    straighten()
    return wall


def sensor(rate_hz: float = 10.0, preset: str = "velodyne_vlp16") -> Any:
    bpy.context.scene.cursor.location = (0, 0, 0)
    bpy.ops.echocast.add_sensor(preset=preset)
    thing = bpy.context.object
    values = {"pattern.azimuth.rate_hz": rate_hz, "range.max_m": 300.0}
    for one in thing.echocast.parameters:
        if one.name in values:
            one.number = values[one.name]
    return thing


def clouds(number: int) -> "list[ec.PointCloud]":
    frame = scan.prepare(bpy.context, number)
    return [result.cloud for result in scan.run(frame, lambda fraction: True)]


def settings() -> Any:
    wanted = bpy.context.scene.echocast
    wanted.columns, wanted.noise = "x,y,z,range,time,beam,true_x,velocity_x", False
    return wanted


def test_each_beam_sees_the_scene_at_its_own_time() -> None:
    moving_wall(5.0)
    sensor()
    settings()
    for number in (1, 3):
        cloud = clouds(number)[0]
        assert len(cloud) > 3000
        # Times count in seconds of the animation: frame 0 is 0.
        time = cloud.time
        assert abs(time.min() - number / 25) < 0.1 and time.max() - time.min() > 0.04
        x = cloud.true_x + cloud.origin[0]
        assert np.abs(x - (10 + 5.0 * time)).max() < 2e-3
        assert np.abs(cloud.velocity_x - 5.0).max() < 1e-2


def test_without_motion_the_scene_stands_still() -> None:
    moving_wall(5.0)
    sensor()
    settings().motion = False
    cloud = clouds(3)[0]
    assert np.ptp(cloud.true_x) < 1e-4 and abs(cloud.true_x[0] + cloud.origin[0] - (10 + 5.0 * 3 / 25)) < 1e-3


def test_sensors_move_along_paths_and_with_parents() -> None:
    """Past a wall that stands still: its distance falls as the sensor's parent comes nearer."""
    bpy.ops.mesh.primitive_plane_add(size=400, rotation=(0, math.pi / 2, 0), location=(50, 0, 0))
    thing = sensor()
    car = bpy.data.objects.new("car", None)
    bpy.context.collection.objects.link(car)
    thing.parent = car
    car.keyframe_insert("location", frame=0)
    car.location.x = 40.0
    car.keyframe_insert("location", frame=100)
    straighten()
    settings()
    cloud = clouds(2)[0]
    # What it measures is the distance along x from where it was.
    place = 10.0 * cloud.time
    direction = (cloud.true_x + cloud.origin[0] - place) / cloud.range
    assert np.abs(place + cloud.range * direction - 50).max() < 1e-2
    assert np.abs(cloud.true_x + cloud.origin[0] - 50).max() < 1e-3
    assert cloud.range.min() > 48.5


def test_vertices_move_within_a_scan() -> None:
    bpy.ops.mesh.primitive_plane_add(size=400, rotation=(0, math.pi / 2, 0), location=(10, 0, 0))
    wall = bpy.context.object
    wall.shape_key_add(name="Basis")
    key = wall.shape_key_add(name="away")
    for point in key.data:
        # Its own z is x of the world.
        point.co.z += 20.0
    key.value = 0.0
    key.keyframe_insert("value", frame=0)
    key.value = 1.0
    key.keyframe_insert("value", frame=100)
    straighten()
    sensor()
    settings()
    cloud = clouds(2)[0]
    assert len(cloud) > 3000
    assert np.abs(cloud.true_x + cloud.origin[0] - (10 + 5.0 * cloud.time)).max() < 5e-3
    # And at the frame after that it is where it is then.
    still = settings()
    still.motion = False
    assert abs(clouds(3)[0].true_x[0] + clouds(3)[0].origin[0] - 10.6) < 1e-3


def test_a_turning_sensor_sees_a_room_as_it_is() -> None:
    """A room scanned while turning has the walls of one that is scanned at rest."""
    bpy.ops.mesh.primitive_cube_add(size=20)
    thing = sensor()
    thing.rotation_euler.z = 0.0
    thing.keyframe_insert("rotation_euler", frame=0)
    thing.rotation_euler.z = math.radians(360)
    thing.keyframe_insert("rotation_euler", frame=50)
    straighten()
    settings()
    moving = clouds(1)[0]
    bpy.context.scene.echocast.motion = False
    still = clouds(1)[0]
    off = [np.abs(np.abs(cloud.xyz + cloud.origin).max(axis=1) - 10) for cloud in (moving, still)]
    assert off[0].max() < off[1].max() + 1e-3 and abs(off[0].mean() - off[1].mean()) < 1e-4


def test_ranges_of_frames_give_an_object_each_and_leave_the_frame() -> None:
    wall = moving_wall(5.0)
    sensor()
    wanted = settings()
    wanted.frames, wanted.step = "RANGE", 2
    bpy.context.scene.frame_set(7)
    assert bpy.ops.echocast.scan() == {"FINISHED"}
    results = sorted(one.name for one in bpy.data.objects if scene.RESULT in one)
    assert [name.split()[-1] for name in results] == ["1", "3"]
    assert bpy.context.scene.frame_current == 7
    assert abs(wall.location.x - (10 + 5.0 * 7 / 25)) < 1e-5


def test_a_scene_that_does_not_move_is_evaluated_once(monkeypatch: pytest.MonkeyPatch) -> None:
    bpy.ops.mesh.primitive_cube_add(size=20)
    sensor()
    calls: "list[Any]" = []
    original = scan.sample
    monkeypatch.setattr(scan, "sample", lambda *arguments: (calls.append(1), original(*arguments))[1])
    clouds(1)
    assert not calls
