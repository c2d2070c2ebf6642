"""Scans for PyTorch, made on the fly, without files. Needs the package torch.

    from echocast.torch import ScanDataset, collate

    data = ScanDataset("drive.yaml", epochs_differ=True)
    loader = torch.utils.data.DataLoader(data, batch_size=4, num_workers=2, collate_fn=collate)
"""

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

import echocast as ec
from echocast._convert import package
from echocast._training import COLUMNS, positions, source

if TYPE_CHECKING:
    import torch

    from echocast._echocast import Keys, Path
else:
    torch = package("torch", "torch")

__all__ = ["ScanDataset", "ScanStream", "collate"]

# Seeds of epochs are this far apart, so that no epoch of one seed is an epoch of a nearby seed.
STRIDE = 0x9E3779B97F4A7C15


class _Scans:
    """Base of the data sets: a scenario, which every process reads for itself, and the epoch."""

    def __init__(
        self,
        scenario: "ec.Scenario | Keys",
        samples: Sequence[int] | None = None,
        transform: Callable[[dict[str, Any]], Any] | None = None,
        *,
        folder: "Path" = "",
        sensor: int = 0,
        frame: int = 0,
        columns: Sequence[str] = COLUMNS,
        epochs_differ: bool = False,
    ) -> None:
        self.source, self.folder = source(scenario, folder)
        self.transform, self.sensor, self.frame = transform, sensor, frame
        self.columns = tuple(columns)
        self.epochs_differ = epochs_differ
        # Workers that persist from epoch to epoch see what `set_epoch` writes here.
        self._epoch = torch.zeros((), dtype=torch.int64).share_memory_()
        # The scenario, once this process has read it, and the epoch whose seed is set in it.
        self._read: tuple[ec.Scenario, int] | None = None
        read = self._scenario()
        self.seed = read.seed
        self.samples = list(range(len(read)) if samples is None else samples)

    def _scenario(self) -> ec.Scenario:
        """This process's scenario, with the seed of the epoch."""
        if self._read is None:
            # Workers are processes: each with one thread.
            self._read = (ec.Scenario(self.source, folder=self.folder, threads=1), 0)
        scenario, drawn = self._read
        epoch = self.epoch if self.epochs_differ else 0
        if epoch != drawn:
            scenario.set("seed", (self.seed + epoch * STRIDE) % 2**64)
            self._read = (scenario, epoch)
        return scenario

    def _item(self, number: int) -> Any:
        """Sample `number` as a dict of tensors, or what `transform` returns for it."""
        cloud = self._scenario()[number].cloud(self.sensor, self.frame)
        item = {"positions": torch.from_numpy(positions(cloud)), "sample": number} | cloud.to_torch(self.columns)
        return item if self.transform is None else self.transform(item)

    @property
    def epoch(self) -> int:
        """Number of the epoch, from 0."""
        return int(self._epoch)

    def set_epoch(self, epoch: int) -> None:
        """Sets the epoch, from 0, for all workers, new or persistent; to be called between two passes over the data."""
        self._epoch.fill_(int(epoch))

    def __getstate__(self) -> dict[str, Any]:
        # Engines and scenes are not sent to other processes.
        return {**self.__dict__, "_read": None}


class ScanDataset(_Scans, torch.utils.data.Dataset):
    """The samples of a scenario: item i is the cloud of sample `samples[i]`, the same in every process.

    `scenario`, `folder`: as for `echocast.Scenario`; each worker reads them for itself. `samples`: numbers of the samples;
    None: all. `sensor` and `frame`: which scan of each sample. `columns`: columns of an item in addition to `positions`.
    `transform`: called with each item, a dict of tensors: `positions`, n x 3 float32, m, relative to the sensor's position
    at the start of the scan; the columns, n long, integers as int64; `sample`, its number.

    With `epochs_differ`, `set_epoch` changes the seed of everything that is drawn at random; epoch 0 is the set that
    `echocast run` writes.

    >>> from echocast.torch import ScanDataset, collate
    >>> import torch
    >>> data = ScanDataset({
    ...     "scene": {"generate": {"indoor": {"rooms": [1, 1]}}},
    ...     "sensors": [{"sensor": "velodyne_vlp16"}],
    ...     "trajectory": {"camera": "Scanner"},
    ...     "samples": 3,
    ... })
    >>> item = data[1]
    >>> item["sample"], item["positions"].shape[1], item["category_id"].dtype
    (1, 3, torch.int64)
    >>> loader = torch.utils.data.DataLoader(data, batch_size=2, collate_fn=collate)
    >>> [batch["sample"].tolist() for batch in loader]
    [[0, 1], [2]]
    """

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, index: int) -> Any:
        return self._item(self.samples[index])


class ScanStream(_Scans, torch.utils.data.IterableDataset):
    """The samples of a scenario one after the other, each once per epoch, divided among the ranks of
    `torch.distributed`, if that is initialised, and the workers of a DataLoader.

    Takes the arguments of `ScanDataset` and yields the same items. With `shuffle`, each epoch has its own order, given by
    the scenario's seed and `set_epoch`. All ranks get the same number of samples: where the samples do not divide evenly,
    the first ones occur twice.

    >>> from echocast.torch import ScanStream
    >>> stream = ScanStream({
    ...     "scene": {"generate": {"indoor": {"rooms": [1, 1]}}},
    ...     "sensors": [{"sensor": "velodyne_vlp16"}],
    ...     "trajectory": {"camera": "Scanner"},
    ...     "samples": 3,
    ... }, shuffle=True)
    >>> sorted(item["sample"] for item in stream)
    [0, 1, 2]
    """

    def __init__(
        self,
        scenario: "ec.Scenario | Keys",
        samples: Sequence[int] | None = None,
        transform: Callable[[dict[str, Any]], Any] | None = None,
        *,
        shuffle: bool = False,
        **options: Any,
    ) -> None:
        super().__init__(scenario, samples, transform, **options)
        self.shuffle = shuffle
        # Rank and number of ranks of the process that started this one.
        self._ranks: tuple[int, int] | None = None

    def __iter__(self) -> Iterator[Any]:
        rank, ranks = _ranks() or self._ranks or (0, 1)
        worker = torch.utils.data.get_worker_info()
        first, step = (0, 1) if worker is None else (worker.id, worker.num_workers)
        order = self.samples
        if self.shuffle:
            order = np.random.default_rng([self.seed, self.epoch]).permutation(order).tolist()
        count = -(-len(order) // ranks)
        mine = [order[(rank + place * ranks) % len(order)] for place in range(count)]
        return map(self._item, mine[first::step])

    def __getstate__(self) -> dict[str, Any]:
        # A spawned worker does not know the ranks.
        return {**super().__getstate__(), "_ranks": _ranks() or self._ranks}


def _ranks() -> tuple[int, int] | None:
    """The rank of this process and the number of ranks, if they are known."""
    distributed = torch.distributed
    if distributed.is_available() and distributed.is_initialized():
        return distributed.get_rank(), distributed.get_world_size()
    return None


def collate(items: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Clouds of unequal length as one batch: concatenated tensors, `batch`, the item of each point, and `starts`, the
    first point of each item and the end.

    >>> import torch
    >>> from echocast.torch import collate
    >>> items = [{"positions": torch.zeros(count, 3), "sample": number} for number, count in enumerate([2, 3])]
    >>> batch = collate(items)
    >>> batch["positions"].shape, batch["batch"].tolist(), batch["starts"].tolist(), batch["sample"].tolist()
    (torch.Size([5, 3]), [0, 0, 1, 1, 1], [0, 2, 5], [0, 1])
    """
    lengths = torch.tensor([len(item["positions"]) for item in items])
    starts = torch.nn.functional.pad(lengths.cumsum(0), (1, 0))
    batch = {"batch": torch.repeat_interleave(torch.arange(len(items)), lengths), "starts": starts}
    for name, value in items[0].items():
        together = [item[name] for item in items]
        batch[name] = torch.cat(together) if torch.is_tensor(value) and value.ndim else torch.as_tensor(together)
    return batch
