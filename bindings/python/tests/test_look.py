"""Ways to look: Rerun, pictures in viewers, matplotlib."""

import importlib.util
import shutil
import subprocess
import sys
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import echocast as ec
from echocast import _look


@pytest.fixture
def no_rerun(monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "rerun" else find(name))


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Files that a viewer was started for, on a machine with a display."""
    files: list[str] = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")
    monkeypatch.setattr(subprocess, "Popen", lambda command, **options: files.append(command[1]))
    return files


def columns(path: Path) -> dict[tuple[str, str], list[tuple[Any, Any]]]:
    """What a recording holds: by entity and component, rows as (time, value); time is None of what is static."""
    chunk = pytest.importorskip("rerun.chunk")
    found: dict[tuple[str, str], list[tuple[Any, Any]]] = {}
    for one in chunk.RrdReader(path).stream():
        batch = one.to_record_batch()
        for name in batch.schema.names:
            rows = batch.column(name).to_pylist()
            times = batch.column("time").to_pylist() if "time" in batch.schema.names else [None] * len(rows)
            found.setdefault((str(one.entity_path), name), []).extend(zip(times, rows))
    return found


def test_clouds_are_recorded_with_names_and_boxes(room: ec.Scene, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    made = room.scan("velodyne_vlp16", at=(0, 0, 1.8), seed=7, start_time=2.0, organised=True, boxes=True)
    path = tmp_path / "room.rrd"
    made.show(path=path)
    found = columns(path)
    ((time, positions),) = found["/cloud/points", "Points3D:positions"]
    ((_, classes),) = found["/cloud/points", "Points3D:class_ids"]
    seen = np.isfinite(made.x)
    assert np.array_equal(np.array(positions, dtype=np.float32), made.xyz[seen])
    assert np.array_equal(classes, made.category_id[seen])
    assert 2.0 <= time.total_seconds() < 2.1
    ((_, context),) = found["/cloud", "AnnotationContext:context"]
    infos = [entry["class_description"]["info"] for entry in context[0]]
    assert {info["id"]: info["label"] for info in infos} == made.categories
    ((_, centers),) = found["/cloud/boxes", "Boxes3D:centers"]
    ((_, halves),) = found["/cloud/boxes", "Boxes3D:half_sizes"]
    assert made.boxes is not None and np.allclose(centers, [box.center for box in made.boxes])
    assert np.allclose(2 * np.array(halves), [box.size for box in made.boxes], atol=1e-6)


def test_several_clouds_and_a_path_are_one_recording(room: ec.Scene, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    path = ec.Trajectory([0.0, 1.0], np.array([[0.0, 0, 2], [4, 0, 2]]))
    clouds = [room.scan("velodyne_vlp16", at=path, start_time=time, coordinates="sensor") for time in (0.0, 0.5)]
    file = tmp_path / "drive.rrd"
    _look.show({"top": clouds, "path": path}, path=file, color="range")
    found = columns(file)
    points = found["/top/points", "Points3D:positions"]
    assert [round(time.total_seconds(), 1) for time, _ in points] == [0.0, 0.5]
    places = [value[0] for _, value in found["/top", "Transform3D:translation"]]
    assert np.allclose(places, [cloud.sensor_pose.position for cloud in clouds])
    assert len(found["/top/points", "Points3D:colors"][0][1]) == len(clouds[0])
    ((_, line),) = found["/path/line", "LineStrips3D:strips"]
    assert np.allclose(line[0][0], [0, 0, 2]) and np.allclose(line[0][-1], [4, 0, 2])
    assert len(found["/path/sensor", "Transform3D:translation"]) == _look.POSES


def test_pings_are_recorded(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    scene = ec.Scene.generate("seabed", seed=3)
    ping = scene.ping("sbes_200", at=scene.camera("Sonar"), start_time=1.5)
    _look.show([ping], path=tmp_path / "ping.rrd")
    ((time, tensor),) = columns(tmp_path / "ping.rrd")["/pings/levels", "Tensor:data"]
    assert time.total_seconds() == 1.5 and tensor[0]["shape"] == list(ping.levels.shape)


def test_an_active_recording_is_used(cloud: ec.PointCloud) -> None:
    rr = pytest.importorskip("rerun")
    with rr.RecordingStream("test") as stream:
        memory = stream.memory_recording()
        cloud.show(name="mine")
        assert memory.num_msgs() > 2


def test_without_rerun_the_picture_is_opened(cloud: ec.PointCloud, no_rerun: None, opened: list[str]) -> None:
    cloud.show()
    cloud.show(color="category")
    for file in opened:
        with open(file, "rb") as picture:
            assert picture.read(4) == b"\x89PNG"
    assert len(opened) == 2
    with pytest.raises(ec.UnsupportedError, match="of a Trajectory there is no picture"):
        _look.show(ec.Trajectory([0.0], np.zeros((1, 3))))


def test_what_is_missing_is_told(
    cloud: ec.PointCloud, no_rerun: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    if sys.platform != "darwin":
        with pytest.raises(ec.UnsupportedError, match="there is no display"):
            cloud.show()
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(ec.UnsupportedError, match="there is no program"):
        cloud.show()
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(ImportError, match="pip install rerun-sdk"):
        cloud.show(path=tmp_path / "a.rrd")


def test_wrong_arguments_are_told(cloud: ec.PointCloud, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    with pytest.raises(ec.ArgumentError, match="ends in .rrd"):
        cloud.show(path=tmp_path / "a.png")
    with pytest.raises(ec.ArgumentError, match="of the type int; allowed: a PointCloud"):
        _look.show(3, path=tmp_path / "a.rrd")
    with pytest.raises(KeyError, match="no column"):
        cloud.show(path=tmp_path / "a.rrd", color="doppler")


def test_notebooks_show_the_picture(cloud: ec.PointCloud, no_rerun: None, monkeypatch: pytest.MonkeyPatch) -> None:
    display = pytest.importorskip("IPython.display")
    shown: list[Any] = []
    monkeypatch.setattr(display, "display", shown.append)
    monkeypatch.setattr("IPython.get_ipython", lambda: types.SimpleNamespace(kernel=object()))
    cloud.show()
    assert shown[0].data.startswith(b"\x89PNG")


@pytest.fixture
def pyplot() -> Iterator[Any]:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    yield plt
    plt.close("all")


@pytest.mark.parametrize("view", ["top", "side", "3d"])
@pytest.mark.parametrize("color", [None, "instance", "range"])
def test_plots_have_all_points(room: ec.Scene, pyplot: Any, view: Any, color: str | None) -> None:
    made = room.scan("velodyne_vlp16", at=(0, 0, 1.8), seed=7, organised=True)
    ax = made.plot(view=view, color=color)
    seen = np.isfinite(made.x)
    points = ax.collections[0]
    assert len(points.get_offsets()) == seen.sum()
    assert ax.get_xlabel() == "x / m" and ax.get_ylabel() == ("z / m" if view == "side" else "y / m")
    if color is None:
        assert {text.get_text() for text in ax.get_legend().get_texts()} == {"road", "building"}
    ax.figure.canvas.draw()
    if view == "top":
        # What is above hides what is below.
        order = np.argsort(made.z[seen], kind="stable")
        assert np.allclose(points.get_offsets()[:, 0], made.x[seen][order] + made.origin[0])


def test_plots_go_where_they_are_to(cloud: ec.PointCloud, pyplot: Any) -> None:
    _, axes = pyplot.subplots(1, 2)
    assert cloud.plot(ax=axes[1], color="intensity") is axes[1]
    with pytest.raises(ec.ArgumentError, match="view is 'front'; allowed: top"):
        cloud.plot(view="front")  # type: ignore[arg-type]
    with pytest.raises(ec.ArgumentError, match="projection"):
        cloud.plot(view="3d", ax=axes[0])
    nothing = cloud[:0].plot()
    assert len(nothing.collections[0].get_offsets()) == 0 and nothing.get_legend() is None


def test_looking_needs_numpy_alone() -> None:
    """The module is there without what it shows with."""
    program = "import sys, echocast._look; assert not {'rerun', 'matplotlib', 'IPython'} & set(sys.modules)"
    assert subprocess.run([sys.executable, "-c", program]).returncode == 0
