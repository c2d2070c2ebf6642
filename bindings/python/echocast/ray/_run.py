"""Makes a set on a cluster: what is missing is found, divided among workers, and completed."""

import json
import tempfile
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import ray

import echocast as ec
from echocast.ray import _cluster, _plan
from echocast.ray._finish import finish
from echocast.ray._source import Source
from echocast.ray._store import Store
from echocast.ray._worker import ORIGIN, Made, Worker

if TYPE_CHECKING:
    from echocast._echocast import Keys, Path as AnyPath

#: How many workers try a task: a sample that kills them all must not do so for ever.
TRIES = 4


def run(
    scenario: "ec.Scenario | Keys",
    output: "AnyPath",
    *,
    samples: Sequence[int] | None = None,
    resume: bool = False,
    workers: int | None = None,
    chunk: int | None = None,
    filesystem: Any = None,
    folder: "AnyPath" = "",
    settings: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> dict[str, Any]:
    """Makes samples of a scenario on the Ray cluster that this process is connected to, or on one of this machine alone.

    `scenario`, `folder`: as `echocast.Scenario` takes them, with files where every worker finds them: on a file system that
    all machines share, or relative to the `working_dir` that Ray ships. `settings`: keys of the scenario that are changed,
    `{"environment.fog.visibility_m": 80}`. `output`: the set's folder, on a file system that all machines share, or a URL as
    fsspec takes it, `s3://bucket/set`; with `filesystem`, of fsspec or `pyarrow.fs`, a path in that.

    `samples`: (first, last) or (first, last, step); None: all. `resume`: go on with a set that is there; samples in its
    manifests whose files have their sizes are not made again. `workers`: processes with a CPU each; None: as many as the
    cluster has CPUs now. `chunk`: samples of a task; None: up to 32. `progress`: called with the number of samples done and
    of all.

    Returns what `echocast.run` does, and the number of `workers`. The files are those of `echocast run`, to the byte.

    >>> import echocast.ray
    >>> done = echocast.ray.run({
    ...     "scene": {"generate": {"indoor": {"rooms": [1, 1]}}},
    ...     "sensors": [{"sensor": "velodyne_vlp16"}],
    ...     "trajectory": {"camera": "Scanner"},
    ...     "samples": 3,
    ... }, "set")
    >>> done["made"], done["complete"]
    (3, True)
    """
    start = time.monotonic()
    workers = _cluster.workers(workers)
    source, store = Source(scenario, folder, settings), Store(output, filesystem)
    wanted = _plan.wanted(len(source.read()), samples)
    sizes, before = store.sizes(), store.find(ORIGIN)
    if before is None and any(not name.startswith(".") for name in sizes):
        raise ec.ArgumentError(f"set.folder is {store.name}, which holds other files; allowed: an empty or a new folder")
    crew = Crew(source, store)
    try:
        origin = crew.begin(before, wanted[0])
        known = _plan.noted(store, sizes)
        there = {sample for sample in wanted if sample in known and _plan.complete(known[sample], sizes)}
        if there and not resume:
            found = f"{store.name}, in which {len(there)} of these samples are"
            raise ec.ArgumentError(f"set.folder is {found}; allowed: another folder, or to go on with it (--resume)")
        _write(store, ORIGIN, origin)
        missing = [sample for sample in wanted if sample not in there]
        tasks = _plan.tasks(missing, workers, chunk)
        summary: dict[str, Any] = {"folder": store.name, "made": 0, "found": len(there), "failed": [], "points": 0}
        warnings = Counter[str]()
        if progress:
            progress(len(there), len(wanted))
        for task, made, failed, points, noticed in crew.make(origin, wanted[0], tasks, workers):
            summary["made"] += made
            summary["failed"] += failed
            summary["points"] += points
            warnings.update(noticed)
            there.update(task)
            if progress:
                progress(len(there), len(wanted))
    finally:
        crew.end()
    about = json.loads(origin)
    whole = there.union(known).issuperset(range(about["samples"]))
    if whole:
        finish(store, about["roots"])
        if not summary["found"]:
            # The report of the same samples has one warning of each kind.
            report = json.loads(store.find("report.json") or b"{}")
            warnings = Counter({one["warning"]: one["samples"] for one in report.get("warnings", ())})
    summary["failed"].sort()
    return summary | {
        "seconds": time.monotonic() - start,
        "warnings": dict(sorted(warnings.items())),
        "complete": whole,
        "workers": crew.most,
    }


def _write(store: Store, name: str, content: bytes) -> None:
    """Writes a small file, unless it is there."""
    if store.find(name) != content:
        with tempfile.TemporaryDirectory(prefix="echocast-") as folder:
            Path(folder, name).write_bytes(content)
            store.put([name], folder)


class Crew:
    """The workers of a run: actors of Ray, which has a place for them on any machine of the cluster."""

    def __init__(self, source: Source, store: Store) -> None:
        # As long as it lives, a worker has a CPU.
        worker: Any = ray.remote(num_cpus=1)(Worker)
        self.workers: list[Any] = []
        self.worker: Callable[[], Any] = lambda: worker.remote(source, store)
        self.most = 1

    def hire(self) -> Any:
        """One more."""
        self.workers.append(self.worker())
        return self.workers[-1]

    def begin(self, origin: bytes | None, first: int) -> bytes:
        """`Worker.begin` of the first of them."""
        try:
            begun: bytes = ray.get(self.hire().begin.remote(origin, first))
            return begun
        except ray.exceptions.RayTaskError as error:
            raise error.cause from None
        except ray.exceptions.RayError as error:
            raise ec.Error(f"no worker can begin: {_line(error)}") from error

    def make(self, origin: bytes, first: int, tasks: Sequence[range], most: int) -> Iterator[Made]:
        """Has up to `most` workers make `tasks`; yields what `Worker.make` returns, as it comes."""
        self.most = max(1, min(most, len(tasks)))
        idle = self.workers + [self.hire() for _ in range(self.most - 1)]
        queue, tries = deque(tasks), Counter[range]()
        busy: dict[Any, tuple[Any, range]] = {}
        lost: list[int] = []
        while queue or busy:
            # One task at a time for each, which copies its files before it gets another: nothing piles up anywhere.
            while queue and idle:
                worker, task = idle.pop(), queue.popleft()
                busy[worker.make.remote(origin, first, task)] = worker, task
            # Who has nothing more to do leaves its CPU to those whose machine is gone and that have no other.
            while idle:
                ray.kill(idle.pop())
            [ref], _ = ray.wait(list(busy))
            worker, task = busy.pop(ref)
            try:
                yield ray.get(ref)
                idle.append(worker)
            except ray.exceptions.RayTaskError as error:
                raise error.cause from None
            except ray.exceptions.RayError as error:
                # It has died, or cannot be reached any more.
                ray.kill(worker)
                idle.append(self.hire())
                tries[task] += 1
                if tries[task] < TRIES:
                    queue.append(task)
                else:
                    lost += task
                    reason = error
        if lost:
            one, several = "1 of these samples is not made", f"{len(lost)} of these samples are not made"
            raise ec.Error(
                f"{one if len(lost) == 1 else several}, the first is {min(lost)}: {TRIES} workers have died of them, the last "
                f"one: {_line(reason)}; allowed: to try again (--resume), with more memory or smaller scenes"
            )

    def end(self) -> None:
        """Ends all workers."""
        for worker in self.workers:
            ray.kill(worker)


def _line(error: BaseException) -> str:
    """What Ray says, in one line."""
    return " ".join(str(error).split())
