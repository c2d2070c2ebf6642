"""What a worker of a run does."""

import json
import platform
import tempfile
from pathlib import Path

import echocast as ec

#: What made a set; it appears first, and says which set this is.
ORIGIN = "scenario.json"

#: Where `echocast.run` of the only part of one notes its samples.
LOG = "manifest.0_of_1.jsonl"


class Worker:
    """Makes samples in a folder of its own and copies what is complete to the set. It is an actor: a process that keeps
    what it has read. `source` and `store`: what is made, and where it goes."""

    def __init__(self, source, store):
        self.source, self.store = source, store
        self.scenario = None
        self.sees = False

    def begin(self, origin, first):
        """The `scenario.json` of the set; `origin` is that of the one in the store, or None. What `echocast run` refuses
        is refused here: another scenario, styles that the sensors cannot fill. `first`: number of the first sample."""
        with tempfile.TemporaryDirectory(prefix="echocast-") as folder:
            try:
                self._run(folder, origin, (first, first), progress=_begun)
            except _Begun:
                pass
            except ec.FileError as error:
                raise self._told(error) from error
            except ec.Error as error:
                # The folder that is meant is not this one.
                raise type(error)(str(error).replace(folder, self.store.name)) from error
            return Path(folder, ORIGIN).read_bytes()

    def make(self, origin, task):
        """Makes the samples of a range, `task`, of the set that `origin` says. Returns `task`, how many were made, what has
        failed, the number of points, and warnings, each with the number of its samples."""
        if not self.sees and self.store.find(ORIGIN) != origin:
            allowed = "allowed: a folder that all machines share, or a bucket"
            raise self._told(ec.FileError(f"{self.store.name} does not hold the set that is made; {allowed}"))
        self.sees = True
        with tempfile.TemporaryDirectory(prefix="echocast-") as folder:
            try:
                done = self._run(folder, origin, (task[0], task[-1], task.step))
            except ec.Error as error:
                raise self._told(error) from error
            lines = [line for line in Path(folder, LOG).read_text().splitlines() if line]
            entries = [json.loads(line) for line in lines]
            for error in (entry.get("error") for entry in entries):
                if error and folder in error:
                    # It is not the sample that is wrong, but this machine: its disk is full.
                    raise self._told(ec.FileError(error))
            self.store.put([file["path"] for entry in entries for file in entry["files"]], folder)
            # Samples are there once they are noted, which is what comes last.
            log = f"manifest.{task[0]}_{task[-1]}_{task.step}.jsonl"
            Path(folder, log).write_text("".join(line + "\n" for line in lines))
            self.store.put([log], folder)
        return task, done["made"], done["failed"], done["points"], done["warnings"]

    def _run(self, folder, origin, samples, progress=None):
        """`echocast.run` to `folder`, which does not complete the set."""
        if self.scenario is None:
            self.scenario = self.source.read(threads=1)
        if origin is not None:
            # Who reads another scenario than the others, or other scenes, is refused.
            Path(folder, ORIGIN).write_bytes(origin)
        return ec.run(self.scenario, folder, samples=samples, shard=(0, 1), threads=1, progress=progress)

    def _told(self, error):
        """`error` for people at another machine."""
        text = f"worker on {platform.node()}: {error}"
        if isinstance(error, FileNotFoundError):
            text += "; allowed: files on a file system that all machines share, or in the folder that Ray ships"
        return type(error)(text)


class _Begun(Exception):
    """A run has checked everything and begins with the first sample."""


def _begun(done, all):
    raise _Begun
