"""Sets and data sets made on a cluster of three nodes: the bytes of one machine, whatever dies or refuses."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import echocast as ec

pytest.importorskip("ray.data")
import ray  # noqa: E402
import ray.cluster_utils  # noqa: E402

import echocast.ray  # noqa: E402
from echocast.ray import _plan, _run  # noqa: E402
from echocast.ray.__main__ import yaml  # noqa: E402
from echocast.ray._source import Source  # noqa: E402
from echocast.ray._store import Store  # noqa: E402
from echocast.ray._worker import Made, Worker  # noqa: E402

ALL_STYLES = [
    {"style": "plain"},
    {"style": "semantic_kitti", "sensor": "top"},
    {"style": "kitti"},
    {"style": "nuscenes"},
    {"style": "webdataset", "samples": 4},
    {"style": "coco", "panoptic": True},
    {"style": "voc"},
]


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """Three nodes of one CPU; those that a test kills are replaced."""
    node = {"num_cpus": 1, "object_store_memory": 100_000_000}
    made = ray.cluster_utils.Cluster(initialize_head=True, head_node_args={**node, "include_dashboard": False})
    made.more = [made.add_node(**node) for _ in range(2)]
    ray.init(address=made.address, log_to_driver=False, logging_level="error")
    yield made
    ray.shutdown()
    made.shutdown()


@pytest.fixture
def file(tent: Path, tmp_path: Path) -> Path:
    """A scenario of twelve samples with a LiDAR and a camera."""
    camera = {"name": "eye", "kind": "lidar", "pattern": {"type": "pinhole", "resolution": [32, 24], "fov_deg": [60, 45]}}
    keys = {
        "scene": {"files": "tent.obj", "labels": {"objects": {"tent": "car"}}},
        "sensors": [{"name": "top", "sensor": "velodyne_vlp16"}, {"name": "eye", "sensor": camera}],
        "trajectory": {"position_m": [-4, 0, 1]},
        "variation": [{"move": "tent", "by_m": [{"uniform": [-1, 1]}, 0, 0]}],
        "samples": 12,
        "seed": 3,
        "set": {"splits": "70/30"},
    }
    path = tmp_path / "drive.yaml"
    path.write_text(json.dumps(keys))
    return path


def alone(file: Path, folder: Path, **settings: Any) -> tuple[dict[str, Any], dict[str, bytes]]:
    """What `echocast run` makes on one machine: its summary and its files."""
    scenario = ec.Scenario(file)
    for key, value in settings.items():
        scenario.set(key, value)
    return ec.run(scenario, folder), files(folder)


def files(folder: Path) -> dict[str, bytes]:
    found = (path for path in Path(folder).rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in found}


def same(found: dict[str, bytes], expected: dict[str, bytes]) -> None:
    assert found.keys() == expected.keys()
    assert [name for name in expected if found[name] != expected[name]] == []


# --- what needs no cluster


def test_samples_are_divided_into_ranges() -> None:
    assert _plan.wanted(9, (1, 7, 3)) == range(1, 8, 3)
    for wrong in [(0, 9), (5, 4), (0, 3, 0), (-1, 2)]:
        with pytest.raises(ec.ArgumentError, match="allowed: 0 to 8, which the scenario has"):
            _plan.wanted(9, wrong)
    numbers = [0, 1, 2, 3, 4, 7, 9, 11, 20]
    for most in (1, 2, 3, 50):
        tasks = _plan.tasks(numbers, 3, most)
        assert [number for task in tasks for number in task] == numbers
        assert max(map(len, tasks)) <= most
    assert _plan.tasks(range(5, 300, 7), 1, 100) == [range(5, 300, 7)]
    # The last tasks are short, so that nobody waits long for another.
    lengths = [len(task) for task in _plan.tasks(range(1000), 4)]
    assert sum(lengths) == 1000 and lengths == sorted(lengths, reverse=True) and (lengths[0], max(lengths[-4:])) == (32, 4)


def test_values_are_yaml_1_2() -> None:
    assert yaml("{on: {category: road}, to: [1, -2.5, 1e-3, ~, true, no]}") == {
        "on": {"category": "road"},
        "to": [1, -2.5, 1e-3, None, True, "no"],
    }


def command(
    *arguments: object, folder: Path = Path(__file__).parent, env: dict[str, str] | None = None
) -> "subprocess.CompletedProcess[str]":
    program = [sys.executable, "-m", "echocast.ray", *map(str, arguments)]
    return subprocess.run(program, capture_output=True, text=True, timeout=100, cwd=folder, env=env)


def test_wrong_usage_ends_with_2() -> None:
    help = command("--help")
    assert help.returncode == 0 and "--samples 0:99999 --address auto -o s3://bucket/set" in help.stdout
    for arguments in [["drive.yaml"], ["drive.yaml", "-o", "x", "--samples", "7"], ["drive.yaml", "-o", "x", "--set", "seed"]]:
        assert command(*arguments).returncode == 2


# --- sets


def test_every_style_has_the_bytes_of_one_machine(cluster: Any, file: Path, tmp_path: Path) -> None:
    done, expected = alone(file, tmp_path / "one", outputs=ALL_STYLES)
    told = []
    made = echocast.ray.run(
        file,
        tmp_path / "set",
        settings={"outputs": ALL_STYLES},
        chunk=2,
        progress=lambda done, all: told.append((done, all)),
    )
    same(files(tmp_path / "set"), expected)
    assert told == [(count, 12) for count in range(0, 13, 2)]
    for key in ["made", "found", "failed", "points", "warnings", "complete"]:
        assert made[key] == done[key]
    assert made["workers"] == 3


def test_samples_that_fail_are_told_and_the_others_go_on(cluster: Any, file: Path, tmp_path: Path) -> None:
    outputs, rule = [{"style": "plain"}], {"set": "environment.fog.visibility_m", "to": {"grid": [50, 50, -1]}}
    settings = {"outputs": outputs, "variation": [rule]}
    done, expected = alone(file, tmp_path / "one", **settings)
    made = echocast.ray.run(file, tmp_path / "set", settings=settings)
    assert made["failed"] == done["failed"] and [sample for sample, _ in made["failed"]] == [2, 5, 8, 11]
    same(files(tmp_path / "set"), expected)


def test_what_is_there_is_not_made_again(cluster: Any, file: Path, tmp_path: Path) -> None:
    _, expected = alone(file, tmp_path / "one")
    root = tmp_path / "set"
    first = echocast.ray.run(file, root, samples=(1, 9, 2), chunk=1)
    assert (first["made"], first["complete"]) == (5, False)
    with pytest.raises(ec.ArgumentError, match="5 of these samples are; allowed: another folder, or to go on"):
        echocast.ray.run(file, root)
    # One file is gone, one is too short, and a worker has left something unfinished.
    (root / "data/000003/top.npz").unlink()
    with (root / "data/000005/top.npz").open("r+b") as cut:
        cut.truncate(100)
    (root / "pictures/.echocast-left").write_text("half a picture")
    then = (root / "data/000007/top.npz").stat().st_mtime_ns
    second = echocast.ray.run(file, root, resume=True)
    assert (second["found"], second["made"], second["complete"]) == (3, 9, True)
    assert (root / "data/000007/top.npz").stat().st_mtime_ns == then
    same(files(root), expected)
    assert echocast.ray.run(file, root, resume=True)["found"] == 12
    same(files(root), expected)


def test_what_does_not_belong_together_is_refused(cluster: Any, file: Path, tmp_path: Path) -> None:
    root = tmp_path / "set"
    echocast.ray.run(file, root, samples=(0, 1))
    before = files(root)
    with pytest.raises(ec.ArgumentError, match=f"^set.folder is {root}, which holds a set of another scenario"):
        echocast.ray.run(file, root, resume=True, settings={"seed": 4})
    with pytest.raises(ec.ArgumentError, match=f"^set.folder is {file.parent}, which holds other files"):
        echocast.ray.run(file, file.parent)
    with pytest.raises(ec.ArgumentError, match="samples is 0 to 12, every 1; allowed: 0 to 11"):
        echocast.ray.run(file, root, samples=(0, 12))
    with pytest.raises(ec.NotFoundError, match="absent.yaml"):
        echocast.ray.run(tmp_path / "absent.yaml", root)
    with pytest.raises(ec.NotFoundError, match="worker on .*absent.obj.*all machines share"):
        echocast.ray.run(file, tmp_path / "other", settings={"scene.files": "absent.obj"})
    with pytest.raises(ec.Error, match="nonsense"):
        echocast.ray.run(file, tmp_path / "other", settings={"nonsense": 1})
    assert files(root) == before and not (tmp_path / "other").exists()


def test_workers_that_see_other_files_are_refused(cluster: Any, file: Path, tent: Path, tmp_path: Path) -> None:
    echocast.ray.run(file, tmp_path / "set", samples=(0, 0))
    origin = (tmp_path / "set/scenario.json").read_bytes()
    with pytest.raises(ec.FileError, match="does not hold the set that is made; allowed: a folder that all machines share"):
        Worker(Source(file, "", {}), Store(tmp_path / "own")).make(origin, 0, range(1))
    tent.write_text(tent.read_text().replace("0 0 2", "0 0 3"))
    with pytest.raises(ec.ArgumentError, match="worker on .* for which tent.obj had other contents"):
        Worker(Source(file, "", {}), Store(tmp_path / "set")).make(origin, 0, range(1))


# --- what dies


def test_a_node_is_killed_in_the_middle(cluster: Any, file: Path, tmp_path: Path) -> None:
    settings = {"samples": 60, "outputs": ALL_STYLES}
    _, expected = alone(file, tmp_path / "one", **settings)

    def kill(done: int, all: int) -> None:
        if 10 <= done < all and len(cluster.more) == 2:
            cluster.remove_node(cluster.more.pop(), allow_graceful=False)

    made = echocast.ray.run(file, tmp_path / "set", settings=settings, chunk=2, progress=kill)
    assert len(cluster.more) == 1 and (made["made"], made["complete"], made["workers"]) == (60, True, 3)
    same(files(tmp_path / "set"), expected)
    cluster.more.append(cluster.add_node(num_cpus=1, object_store_memory=100_000_000))


def test_the_driver_is_killed(cluster: Any, file: Path, tmp_path: Path) -> None:
    root = tmp_path / "set"
    _, expected = alone(file, tmp_path / "one", samples=300)
    arguments = [file, "-o", root, "--set", "samples=300", "--chunk", 2, "--address", cluster.address]
    driver = subprocess.Popen([sys.executable, "-m", "echocast.ray", *map(str, arguments)], cwd=Path(__file__).parent)
    end = time.monotonic() + 60
    while not list(root.glob("manifest.*.jsonl")) and time.monotonic() < end:
        time.sleep(0.02)
    driver.send_signal(signal.SIGKILL)
    driver.wait()
    assert not (root / "manifest.json").exists()
    again = command(*arguments, "--resume")
    assert again.returncode == 0, again.stderr
    assert "were there" in again.stdout and "complete, see report.html" in again.stdout
    same(files(root), expected)


def test_a_sample_that_kills_its_workers_is_told(
    cluster: Any, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Deadly(Worker):
        def make(self, origin: bytes, first: int, task: range) -> Made:
            return os._exit(1) if 3 in task else super().make(origin, first, task)

    with monkeypatch.context() as patch:
        patch.setattr(_run, "Worker", Deadly)
        with pytest.raises(ec.Error, match="^1 of these samples is not made, the first is 3: 4 workers have died of them.*--resume"):
            echocast.ray.run(file, tmp_path / "set", samples=(0, 5), chunk=1)
    assert echocast.ray.run(file, tmp_path / "set", samples=(0, 5), resume=True)["made"] == 1


# --- buckets


@pytest.fixture
def bucket() -> Iterator[Any]:
    """A local S3 that takes objects while `room` lasts, and its file system."""
    s3fs = pytest.importorskip("s3fs")
    pytest.importorskip("moto")
    from moto.server import DomainDispatcherApplication, create_backend_app
    from werkzeug.serving import WSGIRequestHandler, make_server

    class Silent(WSGIRequestHandler):
        def log(self, *arguments: object) -> None:
            pass

    class Bucket:
        room, refusal = 1e9, "QuotaExceeded"
        url: str
        fs: Any
        inner = DomainDispatcherApplication(create_backend_app)

        def __call__(self, environ: dict[str, Any], start_response: Any) -> Any:
            if environ["REQUEST_METHOD"] == "PUT" and environ["PATH_INFO"].count("/") > 1:
                self.room -= 1
                if self.room < 0:
                    environ["wsgi.input"].read(int(environ.get("CONTENT_LENGTH") or 0))
                    start_response("403 Forbidden", [("Content-Type", "application/xml")])
                    return [f"<Error><Code>{self.refusal}</Code><Message>{self.refusal}</Message></Error>".encode()]
            return self.inner(environ, start_response)

    made = Bucket()
    server = make_server("127.0.0.1", 0, made, threaded=True, request_handler=Silent)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    made.url = f"http://127.0.0.1:{server.port}"
    made.fs = s3fs.S3FileSystem(key="key", secret="secret", endpoint_url=made.url, skip_instance_cache=True)
    # Its objects are in this process, whatever the server.
    urllib.request.urlopen(f"{made.url}/moto-api/reset", data=b"").close()
    made.fs.mkdir("bucket")
    yield made
    server.shutdown()


def download(bucket: Any, folder: Path) -> dict[str, bytes]:
    bucket.fs.invalidate_cache()
    bucket.fs.get("bucket/set", str(folder), recursive=True)
    return files(folder)


def test_a_bucket_gets_the_bytes_of_one_machine(cluster: Any, bucket: Any, file: Path, tmp_path: Path) -> None:
    _, expected = alone(file, tmp_path / "one", outputs=ALL_STYLES)
    some = {"outputs": ALL_STYLES, "samples": 6}
    assert echocast.ray.run(file, "bucket/set", filesystem=bucket.fs, settings=some)["complete"]
    # It grows, so that archives are joined anew.
    all = {"outputs": ALL_STYLES}
    assert echocast.ray.run(file, "bucket/set", filesystem=bucket.fs, settings=all, resume=True)["found"] == 6
    same(download(bucket, tmp_path / "set"), expected)


def test_the_command_writes_to_a_url(cluster: Any, bucket: Any, file: Path, tmp_path: Path) -> None:
    _, expected = alone(file, tmp_path / "one")
    keys = {"AWS_ENDPOINT_URL": bucket.url, "AWS_ACCESS_KEY_ID": "key", "AWS_SECRET_ACCESS_KEY": "secret"}
    # A cluster of its own, whose workers have the keys.
    arguments = [file.name, "-o", "s3://bucket/set", "--ship", "--address", "local", "--workers", 1]
    done = command(*arguments, folder=file.parent, env={**os.environ, **keys})
    assert done.returncode == 0, done.stderr
    same(download(bucket, tmp_path / "set"), expected)


@pytest.mark.parametrize(("room", "refusal"), [(0, "AccessDenied"), (30, "QuotaExceeded")])
def test_a_bucket_that_takes_no_more_ends_the_run(
    cluster: Any, bucket: Any, file: Path, tmp_path: Path, room: float, refusal: str
) -> None:
    _, expected = alone(file, tmp_path / "one")
    bucket.room, bucket.refusal = room, refusal
    with pytest.raises(ec.FileError, match=f"bucket/set cannot be written: .*{refusal.replace('AccessDenied', 'Access')}"):
        echocast.ray.run(file, "bucket/set", filesystem=bucket.fs, chunk=1)
    bucket.room = 1e9
    assert echocast.ray.run(file, "bucket/set", filesystem=bucket.fs, resume=True)["complete"]
    same(download(bucket, tmp_path / "set"), expected)


def test_pyarrow_writes_too(cluster: Any, bucket: Any, file: Path, tmp_path: Path) -> None:
    from pyarrow import fs

    _, expected = alone(file, tmp_path / "one", outputs=[{"style": "webdataset"}])
    host = bucket.url.removeprefix("http://")
    s3 = fs.S3FileSystem(access_key="key", secret_key="secret", endpoint_override=host, scheme="http", region="us-east-1")
    settings = {"outputs": [{"style": "webdataset"}]}
    assert echocast.ray.run(file, "bucket/set", filesystem=s3, settings=settings)["complete"]
    same(download(bucket, tmp_path / "set"), expected)


def test_a_folder_that_cannot_be_written_is_told(cluster: Any, file: Path, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(ec.FileError, match=f"{tmp_path}/taken/set cannot be written"):
        echocast.ray.run(file, tmp_path / "taken/set")


# --- training data


def test_rows_are_the_samples(cluster: Any, file: Path) -> None:
    columns = ["range", "category_id", "x"]
    scenario = ec.Scenario(file)
    data = echocast.ray.dataset(scenario, [7, 2, 5], columns=columns, batch_size=2)
    rows = {row["sample"]: row for row in data.iter_rows()}
    assert rows.keys() == {2, 5, 7}
    for number, row in rows.items():
        cloud = scenario[number].cloud()
        assert all(np.array_equal(row[name], cloud[name]) and row[name].dtype == cloud[name].dtype for name in columns)
        assert row["positions"].shape == (len(cloud), 3) and row["positions"].dtype == np.float32
        assert np.allclose(np.linalg.norm(row["positions"], axis=1), cloud.range, atol=0.2)
    batch = next(iter(echocast.ray.dataset(file, sensor=1).iter_batches(batch_size=12)))
    assert sorted(batch["sample"]) == list(range(12)) and batch["positions"][3].shape[1] == 3
