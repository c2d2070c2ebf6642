"""The workers of a run."""

import json
import platform
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import echocast as ec
from echocast.ray._source import Source
from echocast.ray._store import Store

E = TypeVar("E", bound=ec.Error)

#: Result of `Worker.make`.
Made = tuple[range, int, list[tuple[int, str]], int, Counter[str]]

#: The scenario that a set is made from; it is written first, and identifies the set.
ORIGIN = "scenario.json"

#: Where `echocast.run` records its samples, as the only shard of one.
LOG = "manifest.0_of_1.jsonl"


class Worker:
    """Makes samples in a folder of its own and copies complete ones to the set. It is an actor: a process that keeps what
    it has read. `source` and `store`: what is made, and where it is written."""

    def __init__(self, source: Source, store: Store) -> None:
        self.source, self.store = source, store
        self.scenario: ec.Scenario | None = None
        self.sees = False

    def begin(self, origin: bytes | None, first: int) -> bytes:
        """Returns the `scenario.json` of the set; `origin` is the one in the store, or None. What `echocast run` refuses is
        refused here: another scenario, styles that the sensors cannot fill. `first`: number of the first sample."""
        with tempfile.TemporaryDirectory(prefix="echocast-") as folder:
            try:
                self._run(folder, origin, range(first, first + 1), progress=_begun)
            except _Begun:
                pass
            except ec.FileError as error:
                raise self._told(error) from error
            except ec.Error as error:
                # Name the set's folder, not this temporary one.
                raise type(error)(str(error).replace(folder, self.store.name)) from error
            return Path(folder, ORIGIN).read_bytes()

    def make(self, origin: bytes, first: int, task: range) -> Made:
        """Makes the samples of a range, `task`, of the set that `origin` identifies and that begins with `first`. Returns
        `task`, the number of samples made, the failures, the number of points, and warnings with their number of samples."""
        if not self.sees and self.store.find(ORIGIN) != origin:
            allowed = "allowed: a folder that all machines share, or a bucket"
            raise self._told(ec.FileError(f"{self.store.name} does not hold the set that is made; {allowed}"))
        self.sees = True
        with tempfile.TemporaryDirectory(prefix="echocast-") as folder:
            try:
                self._make(folder, origin, first, task)
            except ec.Error as error:
                raise self._told(error) from error
            noted = [(line, json.loads(line)) for line in Path(folder, LOG).read_text().splitlines() if line]
            lines, entries = zip(*[(line, entry) for line, entry in noted if entry["sample"] in task])
            failed = [(entry["sample"], entry["error"]) for entry in entries if "error" in entry]
            for _, told in failed:
                if folder in told:
                    # Not the sample is at fault, but this machine: its disk is full.
                    raise self._told(ec.FileError(told))
            self.store.put([file["path"] for entry in entries for file in entry["files"]], folder)
            # Samples count as made once they are recorded, which is done last.
            log = f"manifest.{task[0]}_{task[-1]}_{task.step}.jsonl"
            Path(folder, log).write_text("".join(line + "\n" for line in lines))
            self.store.put([log], folder)
        points = sum(entry["points"] for entry in entries)
        warnings = Counter(warning for entry in entries for warning in entry.get("warnings", ()))
        return task, len(entries) - len(failed), failed, points, warnings

    def _make(self, folder: str, origin: bytes, first: int, task: range) -> None:
        """Makes `task` in `folder`; failed samples are recorded there."""
        while task:
            try:
                self._run(folder, origin, task)
                return
            except ec.Error:
                if task[0] == first:
                    raise
                # `echocast.run` first makes the first sample to see whether the rest can be written, and ends if that fails.
                # After a good sample that is recorded as if it were made, this sample fails on its own.
                noted = {"sample": first, "files": [], "points": 0, "categories": {}, "ranges": []}
                with Path(folder, LOG).open("a") as log:
                    log.write(f"\n{json.dumps(noted)}\n")
                self._run(folder, origin, range(first, task[0] + 1, task[0] - first))
                task = task[1:]

    def _run(
        self, folder: str, origin: bytes | None, task: range, progress: Callable[[int, int], object] | None = None
    ) -> None:
        """Runs `echocast.run` to `folder`, without completing the set."""
        if self.scenario is None:
            self.scenario = self.source.read(threads=1)
        if origin is not None:
            # A worker that reads a different scenario or different scenes is refused.
            Path(folder, ORIGIN).write_bytes(origin)
        part = (task[0], task[-1], task.step)
        ec.run(self.scenario, folder, samples=part, shard=(0, 1), resume=True, threads=1, progress=progress)

    def _told(self, error: E) -> E:
        """`error` with the name of this machine, for users of another one."""
        text = f"worker on {platform.node()}: {error}"
        if isinstance(error, FileNotFoundError):
            text += "; allowed: files on a file system that all machines share, or in the folder that Ray ships"
        return type(error)(text)


class _Begun(Exception):
    """Raised when a run has checked everything and begins with the first sample."""


def _begun(done: int, all: int) -> None:
    raise _Begun
