"""What `pip install .` asks first, in the root of the repository: what is missing is said before anything is compiled."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]


def ask(folder: Path, **variables: str) -> "subprocess.CompletedProcess[str]":
    """Asks the backend of the root as pip does, with a maturin that has one need."""
    assert 'backend-path = ["bindings/python"]' in (ROOT / "pyproject.toml").read_text()
    (folder / "maturin.py").write_text("def get_requires_for_build_wheel(settings=None):\n    return ['a need of maturin']\n")
    path = os.pathsep.join([str(ROOT / "bindings/python"), str(folder)])
    code = "import backend; print(backend.get_requires_for_build_wheel())"
    environment = {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1", **variables}
    command = [sys.executable, "-c", code]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=ROOT, env=environment)


def test_where_nothing_is_missing_maturin_goes_on(tmp_path: Path) -> None:
    done = ask(tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "['a need of maturin']\n", "")


def test_what_is_missing_is_said(tmp_path: Path) -> None:
    done = ask(tmp_path, ECHOCAST_EMBREE=str(tmp_path))
    told = f"scripts/setup: ECHOCAST_EMBREE is {tmp_path}, where there is no libembree4.so.4\n"
    assert (done.returncode, done.stdout, done.stderr) == (1, "", told)
