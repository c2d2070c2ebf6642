"""Makes a set on a cluster: finds the missing samples, divides them among workers, and completes the set."""

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

#: How many workers try a task: a sample that kills every worker must not do so for ever.
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

    `scenario`, `folder`: as for `echocast.Scenario`, with files where every worker finds them: on a file system shared by all
    machines, or relative to the `working_dir` that Ray ships. `settings`: keys of the scenario to change, such as
    `{"environment.fog.visibility_m": 80}`. `output`: the folder of the set, on a file system shared by all machines, or a
    URL that fsspec supports, such as `s3://bucket/set`; with `filesystem`, of fsspec or `pyarrow.fs`, a path in it.

    `samples`: (first, last) or (first, last, step); None: all. `resume`: continue an existing set; samples in its manifests
    whose files have the recorded sizes are not made again. `workers`: number of processes, with one CPU each; None: as many
    as the cluster has CPUs now. `chunk`: samples per task; None: up to 32. `progress`: called with the number of samples
    done and the total.

    Returns what `echocast.run` returns, and the number of `workers`. The files are identical, byte for byte, to those of
    `echocast run`.

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
            raise ec.ArgumentError(f"set.folder is {found}; allowed: another folder, or to go on with the set (--resume)")
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
            # The report about the same samples has each kind of warning once.
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
    """Writes a small file, unless it has this content already."""
    if store.find(name) != content:
        with tempfile.TemporaryDirectory(prefix="echocast-") as folder:
            Path(folder, name).write_bytes(content)
            store.put([name], folder)


class Crew:
    """The workers of a run: Ray actors, which Ray places on any machine of the cluster."""

    def __init__(self, source: Source, store: Store) -> None:
        # A worker occupies a CPU as long as it lives.
        worker: Any = ray.remote(num_cpus=1)(Worker)
        self.workers: list[Any] = []
        self.worker: Callable[[], Any] = lambda: worker.remote(source, store)
        self.most = 1

    def hire(self) -> Any:
        """Starts one more worker."""
        self.workers.append(self.worker())
        return self.workers[-1]

    def begin(self, origin: bytes | None, first: int) -> bytes:
        """Calls `Worker.begin` of a first worker."""
        try:
            begun: bytes = ray.get(self.hire().begin.remote(origin, first))
            return begun
        except ray.exceptions.RayTaskError as error:
            raise error.cause from None
        except ray.exceptions.RayError as error:
            raise ec.Error(f"no worker can start: {_line(error)}") from error

    def make(self, origin: bytes, first: int, tasks: Sequence[range], most: int) -> Iterator[Made]:
        """Makes `tasks` with up to `most` workers; yields the results of `Worker.make` as they arrive."""
        self.most = max(1, min(most, len(tasks)))
        idle = self.workers + [self.hire() for _ in range(self.most - 1)]
        queue, tries = deque(tasks), Counter[range]()
        busy: dict[Any, tuple[Any, range]] = {}
        lost: list[int] = []
        while queue or busy:
            # One task at a time for each worker, which copies its files before it gets another: nothing piles up.
            while queue and idle:
                worker, task = idle.pop(), queue.popleft()
                busy[worker.make.remote(origin, first, task)] = worker, task
            # Idle workers free their CPUs for workers that must be restarted because their machine is gone.
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
                # The worker has died, or can no longer be reached.
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
                f"{one if len(lost) == 1 else several}, the first is {min(lost)}: {TRIES} workers have died of them, the "
                f"last one: {_line(reason)}; allowed: another try (--resume), with more memory or smaller scenes"
            )

    def end(self) -> None:
        """Ends all workers."""
        for worker in self.workers:
            ray.kill(worker)


def _line(error: BaseException) -> str:
    """The message of a Ray error, in one line."""
    return " ".join(str(error).split())
