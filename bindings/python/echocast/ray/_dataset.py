"""Scans as a `ray.data.Dataset`, made on the fly, without files."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import ray.data

from echocast._training import COLUMNS, positions
from echocast.ray import _cluster
from echocast.ray._source import Source

if TYPE_CHECKING:
    from echocast import Scenario
    from echocast._echocast import Keys, Path


def dataset(
    scenario: "Scenario | Keys",
    samples: Sequence[int] | None = None,
    *,
    columns: Sequence[str] = COLUMNS,
    sensor: int = 0,
    frame: int = 0,
    folder: "Path" = "",
    settings: Mapping[str, Any] | None = None,
    workers: int | None = None,
    batch_size: int = 4,
) -> ray.data.Dataset:
    """A `ray.data.Dataset` with a row for each sample, made by Ray's workers while they are read.

    `scenario`, `folder` and `settings`: as for `run`. `samples`: numbers of the samples; None: all. `sensor` and `frame`:
    which scan of each sample. `columns`: columns of the cloud that a row has in addition to its positions. `workers`: the
    most processes, with one CPU each; None: as many as the cluster has CPUs now. `batch_size`: samples that a worker makes
    at a time.

    | column of a row | |
    |---|---|
    | `sample` | number of the sample, int64 |
    | `positions` | n x 3 float32, m, relative to the sensor's position at the start of the scan |
    | `intensity`, … | n long, with the types and values of `scenario[sample].cloud()` |

    Rows are as long as their clouds, so a batch, as `iter_batches` yields it, is a dict of arrays of arrays. Rows arrive as
    they are made; `ray.data.DataContext.get_current().execution_options.preserve_order` keeps them in order.

    >>> import echocast.ray
    >>> data = echocast.ray.dataset({
    ...     "scene": {"generate": {"indoor": {"rooms": [1, 1]}}},
    ...     "sensors": [{"sensor": "velodyne_vlp16"}],
    ...     "trajectory": {"camera": "Scanner"},
    ...     "samples": 3,
    ... })
    >>> sorted(int(row["sample"]) for row in data.iter_rows())
    [0, 1, 2]
    """
    workers = _cluster.workers(workers)
    source = Source(scenario, folder, settings)
    numbers = range(len(source.read())) if samples is None else list(samples)
    return ray.data.range(len(numbers)).map_batches(
        Scans,
        fn_constructor_args=(source, numbers, tuple(columns), sensor, frame),
        batch_size=batch_size,
        num_cpus=1,
        compute=ray.data.ActorPoolStrategy(min_size=1, max_size=workers),
    )


class Scans:
    """Makes the scans of a batch; an actor that keeps what it has read."""

    def __init__(
        self, source: Source, numbers: Sequence[int], columns: Sequence[str], sensor: int, frame: int
    ) -> None:
        self.scenario = source.read(threads=1)
        self.numbers, self.columns, self.sensor, self.frame = numbers, columns, sensor, frame

    def __call__(self, batch: Mapping[str, npt.NDArray[np.int64]]) -> dict[str, npt.NDArray[Any]]:
        numbers = [self.numbers[index] for index in batch["id"]]
        rows: dict[str, list[npt.NDArray[Any]]] = {name: [] for name in ("positions", *self.columns)}
        for number in numbers:
            cloud = self.scenario[number].cloud(self.sensor, self.frame)
            rows["positions"].append(positions(cloud))
            for name in self.columns:
                rows[name].append(np.array(cloud[name]))
        return {"sample": np.array(numbers, dtype=np.int64)} | {name: _ragged(row) for name, row in rows.items()}


def _ragged(arrays: Sequence[npt.NDArray[Any]]) -> npt.NDArray[np.object_]:
    """An array of arrays of different lengths."""
    together = np.empty(len(arrays), dtype=object)
    together[:] = arrays
    return together
