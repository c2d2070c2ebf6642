"""Errors name the argument that is wrong, in words of this package's users: each argument of every function."""

import importlib
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import echocast as ec

# Type checkers know the tests by other names.
public, mistakes = importlib.import_module("test_docs").public, importlib.import_module("test_mistakes")
FLOOR, TWO = mistakes.FLOOR, mistakes.TWO

EYE = {"name": "eye", "kind": "tof", "pattern": {"type": "pinhole", "resolution": [8, 6], "fov_deg": [60, 45]}}
ROOM = {
    "scene": {"generate": {"indoor": {"rooms": [1, 1]}}},
    "sensors": [{"sensor": EYE}],
    "trajectory": {"camera": "Scanner"},
    "samples": 1,
}

#: Of no type that is allowed anywhere.
NOTHING = object()

#: What is seldom allowed.
WRONG = [NOTHING, -1, 2**70, 2.5, "nothing", "\udcff", b"bytes", [NOTHING], {"a": NOTHING}, {}, (0, 1), float("nan"), True]

#: Arguments whose messages call them something else.
CALLED = {"Scene.from_mesh.mesh": "what a scene is to be made of", "value": "a value", "thing": "a object", "index": "integer"}

#: Those of scans.
SCANS: "dict[str, Any]" = {
    "at": (0, 0, 1.8),
    "fields": "x",
    "seed": 1,
    "frame": 1,
    "strip": 1,
    "start_time": 1.0,
    "trajectory_time": 1.0,
    "estimated_trajectory": (0, 0, 1.8),
    "clock_offset": 0.0,
    "freeze": True,
    "frame_period": 0.1,
    "organised": False,
    "coordinates": "world",
    "order": "beam",
    "boxes": True,
    "box_time": "start",
    "deskew": False,
    "image_boxes": False,
    "profile": "physical",
    "reflectance_source": "library",
    "mask": 1,
    "specular_depth": 1,
    "time_budget": 9.0,
    "environment": {},
    "progress": False,
}


def calls() -> "dict[str, tuple[Callable[..., Any], dict[str, Any]]]":
    """All that takes arguments, with some that are allowed."""
    scene, live, sensor = ec.Scene.from_arrays(FLOOR, TWO), ec.LiveScene(), ec.Sensor(EYE)
    door = live.add(FLOOR, TWO)
    lake = ec.Scene.generate("seabed", seed=3)
    pings = lake.pings("sss_450", 2, at=lake.camera("Sonar"), fields="intensity,category_id")
    image = pings.waterfall()
    echo = scene.radar_frame("ti_awr1843", at=(0, 0, 4))
    cloud = scene.scan(sensor, at=ec.Pose((0, 0, 4), rpy_deg=(0, 90, 0)), organised=True, fields="default,depth")
    scenario, path = ec.Scenario(ROOM), ec.Trajectory([0], [[0, 0, 1]])
    arrays: "dict[str, Any]" = {"vertices": FLOOR, "triangles": TWO}
    moved = {"object": door, "times": [0.0]}
    scans = {"sensor": sensor, **SCANS}
    return {
        "finish": (ec.finish, {"folder": "set", "check": False}),
        "read_cloud": (ec.read_cloud, {"path": "cloud.npz"}),
        "run": (
            ec.run,
            {"scenario": ROOM, "folder": "set", "samples": (0, 0), "shard": (0, 1), "resume": True, "threads": 1, "progress": False},
        ),
        "show": (ec.show, {"thing": cloud, "path": "a.rrd", "name": "a", "time": 0.0, "color": "range"}),
        "Environment": (ec.Environment, {"environment": {}}),
        "Image.coordinates": (image.coordinates, {"column": 0, "row": 0}),
        "Image.__getitem__": (image.__getitem__, {"name": "category_id"}),
        "Image.write": (image.write, {"path": "image.png"}),
        "LiveScene": (ec.LiveScene, {"scene": scene, "threads": 1}),
        "LiveScene.add": (
            live.add,
            {**arrays, "pose": (0, 0, 0), "name": "a", "category": 1, "instance": 1, "material": "wood", "mask": 1, "fixed": True},
        ),
        "LiveScene.add_copy": (
            live.add_copy,
            {"object": door, "pose": (0, 0, 0), "name": "a", "category": 1, "instance": 1, "mask": 1, "fixed": True},
        ),
        "LiveScene.add_mesh": (
            live.add_mesh,
            {
                "mesh": ec.Mesh(**arrays),
                "pose": (0, 0, 0),
                "name": "a",
                "category": 1,
                "instance": 1,
                "parts": [1],
                "mask": 1,
                "fixed": True,
            },
        ),
        "LiveScene.add_scene": (live.add_scene, {"scene": scene}),
        "LiveScene.camera": (live.camera, {"name": "a"}),
        "LiveScene.explain": (live.explain, {**scans, "beam": 0}),
        "LiveScene.find": (live.find, {"name": "a"}),
        "LiveScene.name_label": (live.name_label, {"table": "category", "number": 1, "name": "a"}),
        "LiveScene.ping": (live.ping, scans),
        "LiveScene.radar_frame": (live.radar_frame, {**scans, "sensor": "ti_awr1843", "cube": True, "samples": True}),
        "LiveScene.remove": (live.remove, {"object": door}),
        "LiveScene.scan": (live.scan, scans),
        "LiveScene.set_labels": (live.set_labels, {"object": door, "category": 1, "instance": 1}),
        "LiveScene.set_motion": (live.set_motion, {**moved, "poses": np.eye(4)[None]}),
        "LiveScene.set_pose": (live.set_pose, {"object": door, "pose": (0, 0, 0)}),
        "LiveScene.set_time": (live.set_time, {"time": 0.0, "length": 0.0}),
        "LiveScene.set_vertex_motion": (live.set_vertex_motion, {**moved, "vertices": FLOOR[None]}),
        "LiveScene.set_vertices": (live.set_vertices, {"object": door, "vertices": FLOOR}),
        "Material": (
            ec.Material,
            {
                "material": {"name": "a"},
                "image": np.zeros((2, 2, 4), np.uint8),
                "alpha_image": np.zeros((2, 2), np.uint8),
                "image_matrix": np.eye(3),
                "wrap": "repeat",
                "filter": "nearest",
                "blend": True,
            },
        ),
        "Mesh": (
            ec.Mesh,
            {
                **arrays,
                "name": "a",
                "materials": ["wood"],
                "material_index": [0, 0],
                "uvs": np.zeros((6, 2)),
                "normals": np.tile([0.0, 0.6, 0.8], (6, 1)),
            },
        ),
        "LiveScene.to_scene": (live.to_scene, {"cameras": {"a": (0, 0, 1)}}),
        "Ping.fan": (pings[0].fan, {"pixels": 800}),
        "Ping.__getitem__": (pings[0].__getitem__, {"name": "intensity"}),
        "Pings.depth_map": (pings.depth_map, {"cell_m": 1.0}),
        "Pings.fan": (pings.fan, {"pixels": 800}),
        "Pings.mosaic": (pings.mosaic, {"cell_m": 1.0, "range": "slant", "overlap": "max"}),
        "Pings.png": (pings.png, {"view": "waterfall", "color": "intensity", "width": 400}),
        "Pings.waterfall": (pings.waterfall, {"range": "slant", "beam": 0}),
        "Pings.write": (pings.write, {"path": "pings.npz"}),
        "PointCloud.annotations": (cloud.annotations, {"sensor": sensor}),
        "PointCloud.image": (cloud.image, {"layer": "depth", "sensor": sensor}),
        "PointCloud.plot": (cloud.plot, {"color": "range", "view": "top", "ax": None}),
        "PointCloud.png": (cloud.png, {"color": "range", "view": "range", "width": 400}),
        "PointCloud.read": (ec.PointCloud.read, {"path": "cloud.npz"}),
        "PointCloud.show": (cloud.show, {"path": "a.rrd", "name": "a", "time": 0.0, "color": "range"}),
        "PointCloud.to_ros": (cloud.to_ros, {"driver": "ouster", "stamp": 0.0}),
        "PointCloud.to_torch": (cloud.to_torch, {"columns": "x"}),
        "PointCloud.write": (cloud.write, {"path": "cloud.npz", "format": "npz"}),
        "PointCloud.__getitem__": (cloud.__getitem__, {"key": 0}),
        "Pose": (ec.Pose, {"position": (0, 0, 0), "rpy_deg": None, "quaternion": None}),
        "RadarFrame.image": (echo.image, {"view": "range_doppler", "width": 400}),
        "RadarFrame.png": (echo.png, {"view": "range_doppler", "width": 400}),
        "RadarFrame.write": (echo.write, {"path": "frame.npz"}),
        "Sample.cloud": (scenario[0].cloud, {"sensor": 0, "frame": 0}),
        "Sample.frames": (scenario[0].frames, {"sensor": 0}),
        "Scenario": (ec.Scenario, {"scenario": ROOM, "folder": "", "threads": 1, "scene": None}),
        "Scenario.set": (scenario.set, {"key": "samples", "value": 1}),
        "Scene.camera": (lake.camera, {"name": "Sonar"}),
        "Scene.explain": (scene.explain, {**scans, "beam": 0}),
        "Scene.from_arrays": (
            ec.Scene.from_arrays,
            {**arrays, "categories": [1, 2], "names": {1: "a"}, "name": "a", "material": "wood"},
        ),
        "Scene.from_mesh": (
            ec.Scene.from_mesh,
            {"mesh": type("Mesh", (), {"vertices": FLOOR, "faces": TWO}), "up": "z", "scale": 1.0, "category": "a"},
        ),
        "Scene.from_objects": (ec.Scene.from_objects, {"objects": [arrays], "names": {1: "a"}}),
        "an object": (
            lambda **keys: ec.Scene.from_objects([keys]),  # type: ignore[list-item]
            {**arrays, "name": "a", "pose": (0, 0, 0), "category": 1, "instance": 1, "material": "wood"},
        ),
        "Scene.generate": (ec.Scene.generate, {"kind": "indoor", "seed": 1, "path": "room.glb", "rooms": [1, 1]}),
        "Scene.load": (ec.Scene.load, {"files": "tent.obj", "up": "z"}),
        "Scene.ping": (lake.ping, {**scans, "sensor": "sbes_200"}),
        "Scene.pings": (lake.pings, {**scans, "sensor": "sbes_200", "count": 1}),
        "Scene.radar_frame": (scene.radar_frame, {**scans, "sensor": "ti_awr1843", "cube": True, "samples": True}),
        "Scene.scan": (scene.scan, scans),
        "Sensor": (ec.Sensor, {"sensor": EYE}),
        "Sensor.__getitem__": (sensor.__getitem__, {"key": "range.max_m"}),
        "Sensor.__setitem__": (sensor.__setitem__, {"key": "range.max_m", "value": 9}),
        "Trajectory": (ec.Trajectory, {"times": [0], "positions": [[0, 0, 1]], "quaternions": [[0, 0, 0, 1]]}),
        "Trajectory.at": (path.at, {"time": 0.0}),
        "Trajectory.load": (ec.Trajectory.load, {"path": "drive.txt"}),
    }


CALLS = calls()


def parameters(thing: Any) -> set[str]:
    """Names of what it takes."""
    if not callable(thing) or isinstance(thing, type) and issubclass(thing, Exception):
        return set()
    try:
        found = inspect.signature(thing).parameters.values()
    except ValueError:
        return set()
    return {one.name for one in found if one.kind is not one.VAR_KEYWORD} - {"self"}


def test_every_argument_is_tried() -> None:
    told = {name: set(arguments) for name, (_, arguments) in CALLS.items()}
    for name, thing in public():
        name = name.removeprefix("echocast.")
        if not name.startswith(("torch", "ray")) and parameters(thing) and not name.endswith("__"):
            assert parameters(thing) <= told.get(name, set()), name
    with pytest.raises(TypeError, match="there is no argument") as caught:
        ec.LiveScene().scan("velodyne_vlp16", nonsense=1)  # type: ignore[call-arg]
    assert set(str(caught.value).partition("allowed: ")[2].split(", ")) == set(SCANS)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", CALLS)
def test_wrong_arguments_are_told_by_name(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    call, allowed = CALLS[name]
    for argument in allowed:
        for wrong in WRONG:
            changed = {**allowed, argument: wrong}
            try:
                # What has a sign of its own in Python has no names.
                call(*changed.values()) if name.endswith("item__") else call(**changed)
            except ImportError as error:
                pytest.skip(str(error))
            except Exception as error:
                told = str(error)
                assert not mistakes.RAW.search(told), f"{name}({argument}={wrong!r}): {told}"
                if wrong is NOTHING:
                    assert isinstance(error, (TypeError, ec.ArgumentError)), f"{name}({argument}): {error!r}"
                    called = CALLED.get(f"{name}.{argument}", CALLED.get(argument, argument))
                    assert called in told, f"{name}({argument}): {told}"
            else:
                assert wrong is not NOTHING, f"{name}({argument}) takes anything"
