"""Scenarios, samples and sets."""

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import echocast as ec


@pytest.fixture
def keys(tent: Path, tmp_path: Path) -> dict[str, Any]:
    return {
        "scene": {"files": "tent.obj"},
        "sensors": [{"sensor": "velodyne_vlp16"}],
        "trajectory": {"position_m": [4, 0, 1]},
        "samples": 5,
        "seed": 3,
        "outputs": [{"style": "plain", "format": "npz"}],
        "set": {"folder": str(tmp_path / "set")},
    }


def test_samples_are_those_of_the_set(keys: dict[str, Any], tmp_path: Path) -> None:
    scenario = ec.Scenario(keys, folder=tmp_path)
    assert len(scenario) == 5 and scenario[-1].number == 4
    told = []
    done = ec.run(scenario, progress=lambda made, all: told.append((made, all)))
    assert (done["made"], done["complete"], told[-1]) == (5, True, (5, 5))
    files = sorted((tmp_path / "set").rglob("*.npz"))
    assert len(files) == 5
    sample = scenario[2]
    cloud, written = sample.cloud(), ec.PointCloud.read(files[2])
    assert sample.sensors and sample.frames()[0][1] == 0.0
    assert all(np.array_equal(cloud[name], written[name]) for name in cloud.fields)
    with pytest.raises(ec.Error, match="resume"):
        ec.run(scenario)
    assert ec.run(scenario, resume=True)["found"] == 5


def test_a_scenario_goes_where_it_is_needed(keys: dict[str, Any], tmp_path: Path) -> None:
    scenario = ec.Scenario(keys, folder=tmp_path, threads=1)
    scenario.set("seed", 8)
    again = [pickle.loads(pickle.dumps(scenario)), ec.Scenario(scenario)]
    again.append(ec.Scenario(scenario.to_yaml(), folder=tmp_path))
    cloud = scenario[1].cloud()
    for other in again:
        assert (len(other), other.seed, other.folder) == (5, 8, tmp_path)
        assert np.array_equal(other[1].cloud().range, cloud.range)
    again[1].set("samples", 2)
    assert (len(again[1]), len(scenario)) == (2, 5)
    assert [sample.number for sample in again[1]] == [0, 1] and len(list(reversed(again[1]))) == 2
    scenario.set("scene.files", str(tmp_path / "tent.obj"))
    assert ec.run(scenario.to_yaml())["made"] == 5


def test_a_scenario_of_a_file_goes_to_another_folder(
    keys: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its files are found there, and its set is called as the file, as if the file had been read."""
    del keys["set"]
    # Numbers are written as they were: the set is that of the file.
    (tmp_path / "drive.yaml").write_text(json.dumps({**keys, "trajectory": {"position_m": [4.0, 0.0, 1.0]}}))
    monkeypatch.chdir(tmp_path)
    read = ec.Scenario("drive.yaml")
    sent = pickle.dumps(read)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    there = pickle.loads(sent)
    assert there.folder == tmp_path and len(there[0].cloud()) > 0
    done = ec.run(there, samples=(0, 2))
    assert (done["folder"], done["made"]) == (tmp_path / "drive", 3)
    assert ec.run(tmp_path / "drive.yaml", resume=True)["found"] == 3


def test_only_keys_take_a_folder(keys: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / "drive.yaml").write_text(json.dumps(keys))
    for scenario in (tmp_path / "drive.yaml", ec.Scenario(keys, folder=tmp_path)):
        with pytest.raises(ec.ArgumentError, match=f"folder is {tmp_path}; allowed: none for a file or a Scenario"):
            ec.Scenario(scenario, folder=tmp_path)


def test_what_is_wrong_is_told(keys: dict[str, Any], tmp_path: Path) -> None:
    scenario = ec.Scenario(keys, folder=tmp_path)
    with pytest.raises(IndexError):
        scenario[5]
    with pytest.raises(ec.ArgumentError, match="sensor is 1"):
        scenario[0].cloud(1)
    with pytest.raises(FileNotFoundError):
        ec.Scenario("missing.yaml")

    def stop(made: int, all: int) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        ec.run(scenario, progress=stop)
    # Another run is not stopped by that.
    assert ec.run(scenario, resume=True)["complete"]
