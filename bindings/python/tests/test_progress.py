"""The bar of `progress=True`."""

import io
import os
import subprocess
import sys
import types
from typing import Any

import pytest

from echocast import _progress

import echocast as ec


class Terminal(io.TextIOWrapper):
    """What is written to a terminal, whose `encoding` is given."""

    def __init__(self, encoding: str = "utf-8") -> None:
        self.written = io.BytesIO()
        super().__init__(self.written, encoding=encoding, newline="")

    def isatty(self) -> bool:
        return True

    def lines(self) -> list[str]:
        self.flush()
        return self.written.getvalue().decode(self.encoding).split("\r")[1:]


@pytest.fixture
def hour(monkeypatch: pytest.MonkeyPatch) -> types.SimpleNamespace:
    """The time of day, which tests set, s."""
    hour = types.SimpleNamespace(now=100.0)
    monkeypatch.setattr(_progress, "time", types.SimpleNamespace(monotonic=lambda: hour.now))
    return hour


def test_a_terminal_has_one_line_that_is_redrawn(monkeypatch: pytest.MonkeyPatch, hour: types.SimpleNamespace) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    bar = _progress.bar("scan")
    bar(0.0)
    for step in range(1, 101):
        hour.now += 0.02
        bar(step / 100)
    bar.close()
    bar.close()
    lines = terminal.lines()
    assert 15 <= len(lines) <= 22, "ten times per second, for two seconds"
    assert lines[0].startswith("scan ░") and "left" not in lines[0] and "left" in lines[5]
    assert lines[-1].startswith("scan █") and "100% in 0:02" in lines[-1]
    assert "".join(lines).count("\n") == 1 and lines[-1].endswith("\n")


def test_runs_tell_how_many(monkeypatch: pytest.MonkeyPatch, hour: types.SimpleNamespace) -> None:
    terminal = Terminal("ascii")
    monkeypatch.setattr(sys, "stderr", terminal)
    bar = _progress.bar("run")
    bar(0, 0)
    hour.now += 60
    bar(1, 61)
    bar.close()
    lines = terminal.lines()
    assert "100% 0 of 0" in lines[0]
    assert "2% 1 of 61, 1:00:00 left" in lines[1] and "." * 20 in lines[1]


def test_a_run_that_ends_early_leaves_its_line(monkeypatch: pytest.MonkeyPatch, hour: types.SimpleNamespace) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    bar = _progress.bar("run")
    bar.close()
    assert terminal.lines() == []
    bar = _progress.bar("run")
    bar(1, 10)
    bar(2, 10)
    bar.close()
    assert "2 of 10" in terminal.lines()[-1]


def test_where_there_is_no_terminal_nothing_is_written() -> None:
    program = "from echocast._progress import bar; b = bar('scan'); b(0.5); b(3, 4); b.close()"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    without = f"import sys; sys.stderr = None; {program}"
    assert subprocess.run([sys.executable, "-c", without]).returncode == 0


def test_a_real_terminal_shows_it() -> None:
    pty = pytest.importorskip("pty")
    ours, theirs = pty.openpty()
    program = "from echocast._progress import bar; b = bar('scan'); b(0.5); b(1.0); b.close()"
    done = subprocess.run([sys.executable, "-c", program], stderr=theirs)
    os.close(theirs)
    with open(ours, "rb", buffering=0) as screen:
        assert b"100%" in screen.read(4096) and done.returncode == 0


def test_notebooks_have_an_output_that_changes(monkeypatch: pytest.MonkeyPatch, hour: types.SimpleNamespace) -> None:
    display = pytest.importorskip("IPython.display")
    shown = []

    class Handle:
        def update(self, what: Any) -> None:
            shown.append(what.data)

    def first(what: Any, display_id: bool) -> Handle:
        shown.append(what.data)
        return Handle()

    monkeypatch.setattr(display, "display", first)
    monkeypatch.setattr("IPython.get_ipython", lambda: types.SimpleNamespace(kernel=object()))
    bar = _progress.bar("run")
    for made in range(5):
        hour.now += 1
        bar(made, 4)
    bar.close()
    assert len(shown) == 5 and "100% 4 of 4 in 0:05" in shown[-1]
    # IPython in a terminal has no kernel.
    monkeypatch.setattr("IPython.get_ipython", lambda: types.SimpleNamespace())
    assert not _progress.in_notebook()


def test_it_serves_scans_and_runs(room: ec.Scene) -> None:
    bar = _progress.bar("scan")
    assert len(room.scan("velodyne_vlp16", at=(0, 0, 1.8), progress=bar)) > 1000
    bar.close()
