"""Scenes, sensors, and what goes wrong with them."""

import copy
import pickle
import re
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

import echocast as ec

OWN = {"name": "own", "kind": "lidar", "pattern": {"type": "pinhole", "resolution": [8, 6], "fov_deg": [60, 45]}}


def test_sensors_come_from_names_keys_and_text() -> None:
    vlp = ec.Sensor("VLP-16")
    assert (vlp.name, vlp.kind) == ("velodyne_vlp16", "lidar")
    again = ec.Sensor(vlp.to_yaml())
    assert again.beams == vlp.beams and pickle.loads(pickle.dumps(vlp)).to_yaml() == vlp.to_yaml()
    assert ec.Sensor(OWN).beams == ec.Sensor(MappingProxyType(OWN)).beams == 48
    with pytest.raises(ec.ArgumentError, match="sensor preset"):
        ec.Sensor("velodine")
    with pytest.raises(ec.FormatError, match="pattern"):
        ec.Sensor({"name": "own", "kind": "lidar"})
    assert "velodyne_vlp16" in dict(ec.presets()) and "las" in dict(ec.formats())


def test_keys_of_sensors_are_got_and_set() -> None:
    sensor = ec.Sensor("velodyne_vlp32c")
    assert sensor["noise.range_sigma_m"] > 0
    other = copy.copy(sensor)
    sensor["noise.range_sigma_m"] = 0
    assert sensor["noise.range_sigma_m"] == 0 < other["noise.range_sigma_m"]
    with pytest.raises(KeyError):
        sensor["noise.range_sigma"]
    with pytest.raises(ValueError, match="allowed"):
        sensor["noise.range_sigma_m"] = -1


def test_poses_are_those_of_ros() -> None:
    pose = ec.Pose((1, 2, 3), rpy_deg=(0, 0, 90))
    assert np.allclose(np.array(pose.matrix) @ [1, 0, 0, 1], [1, 3, 3, 1])
    assert pickle.loads(pickle.dumps(pose)) == pose
    assert np.allclose(ec.Pose(quaternion=(0, 0, 2, 0)).quaternion, [0, 0, 1, 0])
    both: dict[str, Any] = dict(rpy_deg=(0, 0, 0), quaternion=(0, 0, 0, 1))
    for wrong in [both, dict(quaternion=(0, 0, 0, 0))]:
        with pytest.raises(ec.ArgumentError):
            ec.Pose(**wrong)
    with pytest.raises(ec.ArgumentError):
        ec.Pose((float("nan"), 0, 0))


def test_trajectories_are_arrays(room: ec.Scene) -> None:
    path = ec.Trajectory([0.0, 1.0], np.array([[0.0, 0, 2], [10, 0, 2]]))
    assert path.at(0.5).position == [5, 0, 2] and path.span == (0, 1)
    assert len(room.scan("velodyne_vlp16", at=path)) > 1000
    with pytest.raises(ec.ArgumentError, match="positions is 2 x 2"):
        ec.Trajectory([0.0, 1.0], np.zeros((2, 2)))
    with pytest.raises(ec.ArgumentError, match="rising"):
        ec.Trajectory([1.0, 0.0], np.zeros((2, 3)))
    with pytest.raises(TypeError, match="positions is of the type str"):
        ec.Trajectory([0.0], "drive.txt")  # type: ignore[arg-type]


def test_scans_take_what_they_know(room: ec.Scene) -> None:
    clear = room.scan("velodyne_vlp16", at=(0, 0, 1.8), fields=["x", "y", "z", "cause"], organised=True)
    assert clear.fields == ["x", "y", "z", "cause"] and clear.organised is not None
    assert clear.organised[0] == 16
    fog = room.scan("velodyne_vlp16", at=(0, 0, 1.8), fields="default,cause", environment={"fog": {"visibility_m": 20}})
    assert (fog.cause == 4).any()
    with pytest.raises(TypeError, match='no argument "sead"; allowed: at'):
        room.scan("velodyne_vlp16", sead=1)  # type: ignore[call-arg]
    with pytest.raises(ValueError, match="near"):
        room.scan("velodyne_vlp16", fields="rnge")
    with pytest.raises(ValueError, match="allowed"):
        room.scan("velodyne_vlp16", order="size")  # type: ignore[arg-type]
    with pytest.raises(ec.Error, match="rate_mm_h"):
        room.scan("velodyne_vlp16", environment={"rain": {"rate_mm_h": -1}})


def test_progress_is_told_and_stops(room: ec.Scene) -> None:
    told: list[float] = []
    room.scan("velodyne_vls128", at=(0, 0, 2), progress=told.append)
    assert told and told == sorted(told) and told[-1] <= 1
    with pytest.raises(ec.CancelledError):
        room.scan("velodyne_vls128", at=(0, 0, 2), progress=lambda fraction: False)
    with pytest.raises(ZeroDivisionError):
        room.scan("velodyne_vls128", at=(0, 0, 2), progress=lambda fraction: 1 / 0)


def test_wrong_arrays_are_told() -> None:
    triangles = np.array([[0, 1, 2]], dtype=np.uint32)
    with pytest.raises(ec.ArgumentError, match="n x 2"):
        ec.Scene.from_arrays(np.zeros((3, 2), dtype=np.float32), triangles)
    with pytest.raises(TypeError, match="vertices is an array of complex128"):
        ec.Scene.from_arrays(np.zeros((3, 3), dtype=complex), triangles)
    with pytest.raises(ec.Error):
        ec.Scene.from_arrays(np.zeros((2, 3), dtype=np.float32), triangles)
    with pytest.raises(ec.Error):
        ec.Scene.from_arrays(np.full((3, 3), np.nan, dtype=np.float32), triangles)
    # What is not contiguous, and what nobody may change, is read as it is.
    wide = np.zeros((3, 6), dtype=np.float32)
    wide[:, ::2] = np.eye(3)
    wide.flags.writeable = False
    assert ec.Scene.from_arrays(wide[:, ::2], triangles).bounds == ([0, 0, 0], [1, 1, 1])


def test_every_option_of_load_that_is_told_is_taken(
    tent: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tent_1.obj").write_text(tent.read_text())
    (tmp_path / "labels.yaml").write_text("objects: {tent: house}")
    takes: dict[str, list[Any]] = {
        "labels": ["street", "labels.yaml", {"objects": {"tent": "house"}}],
        "hide": [["Sky*"], "Sky*"],
        "materials": [{"*": {"reflectance": 0.3}}],
        "up": ["y", "z", "x", "-x", "-y", "-z"],
        "scale": [2.0],
        "joints": [{}],
        "geometry": ["visual", "collision"],
        "model_paths": [["models"]],
        "animation": ["run"],
        "loop": [True],
        "caches": [{"tent": "tent_1.obj"}],
        "texture_limit_mib": [16],
        "allow_outside_paths": [True],
    }
    told = re.findall(r"^\* (`.*?):(?: |$)", ec.Scene.load.__doc__ or "", re.MULTILINE)
    assert re.findall(r"`(\w+)`", " ".join(told)) == list(takes)
    for option, value in [(option, value) for option, values in takes.items() for value in values]:
        try:
            ec.Scene.load(tent, **{option: value})
        except ec.ArgumentError as error:
            assert (option, str(error)) == ("animation", 'there is no animation named "run"')
    assert list(ec.Scene.load(tent, labels="labels.yaml").categories.values()) == ["house"]
    with pytest.raises(ec.NotFoundError, match="missing.yaml"):
        ec.Scene.load(tent, labels="missing.yaml")
    with pytest.raises(ec.FormatError, match='unknown key "lop"; near: loop'):
        ec.Scene.load(tent, lop=True)


def test_files_that_are_not_there_are_told(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as caught:
        ec.Scene.load(tmp_path / "missing.glb")
    assert isinstance(caught.value, ec.Error)
    (tmp_path / "broken.glb").write_bytes(b"glTF")
    with pytest.raises(ec.FormatError, match="broken.glb"):
        ec.Scene.load(str(tmp_path / "broken.glb"))


def test_live_scenes_change(room: ec.Scene) -> None:
    live = ec.LiveScene(room)
    wall = np.array([[0, -1, 0], [0, 1, 0], [0, 0, 2]], dtype=np.float32)
    number = live.add(wall, np.array([[0, 1, 2]], dtype=np.uint32), pose=(3, 0, 0), category=7, name="sign")
    assert live.find("sign") == number

    def places() -> Any:
        seen = live.scan("velodyne_vlp16", at=(0, 0, 1))
        seen = seen[seen.category_id == 7]
        return seen.x + seen.origin[0]

    assert abs(np.median(places()) - 3) < 0.05
    live.set_pose(number, ec.Pose((4, 0, 0)))
    assert abs(np.median(places()) - 4) < 0.05
    matrix = np.eye(4)
    matrix[0, 3] = 5
    live.set_pose(number, matrix)
    assert abs(np.median(places()) - 5) < 0.05
    live.set_vertices(number, wall - np.array([1, 0, 0], np.float32))
    assert abs(np.median(places()) - 4) < 0.05
    live.remove(number)
    assert len(places()) == 0
    with pytest.raises(ec.Error):
        live.remove(number)
    with pytest.raises(ec.Error):
        live.find("sign")
    with pytest.raises(ec.Error):
        live.set_pose(number, (0, 0, 0))
