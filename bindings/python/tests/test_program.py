"""The program that comes with the package."""

import os
import signal
import subprocess
import sys
import sysconfig
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import echocast as ec

PROGRAM = Path(sysconfig.get_path("scripts"), "echocast")


def echocast(*arguments: object, **options: Any) -> "subprocess.CompletedProcess[str]":
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=120, **options)


def test_it_scans_as_python_does(tmp_path: Path) -> None:
    scene, file = tmp_path / "flat.glb", tmp_path / "cloud.npz"
    assert echocast("generate", "indoor", "--rooms", "1,1", "-o", scene).returncode == 0
    done = echocast("scan", scene, "--sensor", "velodyne_vlp16", "--at", "1,1,1.2", "--seed", 7, "-o", file)
    assert done.returncode == 0, done.stderr
    written = ec.PointCloud.read(file)
    made = ec.Scene.load(scene).scan("velodyne_vlp16", at=(1, 1, 1.2), seed=7)
    assert all(np.array_equal(written[name], made[name], equal_nan=True) for name in made.fields)


def test_its_exit_codes_are_those_of_the_program(tmp_path: Path) -> None:
    assert echocast("--help").returncode == 0 and "Usage: echocast" in echocast("--help").stdout
    assert echocast("--version").stdout == f"echocast {ec.__version__}\n"
    wrong = echocast("scan", "--sensr")
    assert wrong.returncode == 2 and "--sensr" in wrong.stderr
    missing = echocast("info", tmp_path / "missing.glb")
    assert missing.returncode == 1 and missing.stderr.startswith("error: ")
    module = subprocess.run([sys.executable, "-m", "echocast", "formats"], capture_output=True, text=True, timeout=60)
    assert module.returncode == 0 and "las" in module.stdout


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_ctrl_c_ends_it(tmp_path: Path) -> None:
    scene = tmp_path / "flat.glb"
    ec.Scene.generate("indoor", rooms=[1, 1], path=scene)
    command: list[Any] = [PROGRAM, "scan", scene, "--sensor", "velodyne_vls128", "--at", "1,1,1.2", "--frames", "0:100000", "-o"]
    running = subprocess.Popen([*command, tmp_path / "c.las", "--single"], stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 60
    while not list(tmp_path.glob("c_*.las")) and time.monotonic() < end:
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    _, told = running.communicate(timeout=120)
    assert running.returncode == 130 and "interrupted" in told


def test_importing_it_imports_nothing_slow() -> None:
    # NumPy would take most of the time until the program starts.
    code = """
import sys, echocast
assert "numpy" not in sys.modules, "NumPy is imported"
assert "show" in dir(echocast) and "show" not in vars(echocast)
from echocast import show
assert echocast.show is show and "numpy" in sys.modules
assert not hasattr(echocast, "shwo")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
