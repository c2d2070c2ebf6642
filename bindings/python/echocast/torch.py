"""Scans for PyTorch, made as they are needed, without files. Needs the package torch.

>>> from echocast.torch import ScanDataset, collate            # doctest: +SKIP
>>> data = ScanDataset("drive.yaml", epochs_differ=True)       # doctest: +SKIP
>>> loader = torch.utils.data.DataLoader(data, batch_size=4, num_workers=2, collate_fn=collate)  # doctest: +SKIP
"""

import numpy as np

import echocast as ec
from echocast._convert import package

torch = package("torch", "torch")

#: Columns that a sample has unless others are asked for.
COLUMNS = ("intensity", "category_id")


class ScanDataset(torch.utils.data.Dataset):
    """The samples of a scenario: item i is the cloud of sample `samples[i]`, the same in every process.

    `scenario`: as `echocast.Scenario` takes it, with `folder`; it is read in each worker for itself. `samples`: their numbers;
    None: all. `sensor` and `frame`: which of its scans. `columns`: those of an item beside `positions`. `transform`: called
    with each item, a dict of tensors: `positions`, n x 3 float32, m, relative to the sensor's place at the start of the
    scan; the columns, n long, integers as int64; `sample`, its number.

    With `epochs_differ`, `set_epoch` changes the seed of everything that is drawn; epoch 0 is the set that
    `echocast run` writes. Workers must then be made anew for each epoch, which is what DataLoader does unless
    `persistent_workers` is set.
    """

    def __init__(
        self, scenario, samples=None, transform=None, *, folder="", sensor=0, frame=0, columns=COLUMNS, epochs_differ=False
    ):
        self.source, self.folder = scenario, folder
        self.transform, self.sensor, self.frame = transform, sensor, frame
        self.columns = tuple(columns)
        self.epochs_differ = epochs_differ
        self.epoch = 0
        count = len(ec.Scenario(scenario, folder=folder, threads=1))
        self.samples = list(range(count)) if samples is None else list(samples)
        # What a process has read, which others do not share.
        self._read = None

    def __len__(self):
        return len(self.samples)

    def __getitem__(self, index):
        number = self.samples[index]
        if self._read is None or self._read[0] != self.epoch:
            # Workers are processes: each with one thread.
            scenario = ec.Scenario(self.source, folder=self.folder, threads=1)
            if self.epoch:
                scenario.set("seed", scenario.seed + self.epoch)
            self._read = (self.epoch, scenario)
        cloud = self._read[1][number].cloud(self.sensor, self.frame)
        place = np.asarray(cloud.origin) - (cloud.sensor_pose.position if cloud.coordinates == "world" else 0)
        item = {"positions": torch.from_numpy(cloud.xyz + place.astype(np.float32)), "sample": number}
        item |= cloud.to_torch(list(self.columns))
        return item if self.transform is None else self.transform(item)

    def set_epoch(self, epoch):
        """Lets everything that is drawn be that of `epoch`, from 0, if epochs differ."""
        if self.epochs_differ:
            self.epoch = int(epoch)

    def __getstate__(self):
        # Engines and scenes do not go to other processes.
        return {**self.__dict__, "_read": None}


def collate(items):
    """Clouds of unequal length as one batch: tensors one after the other, `batch`, the item of each point, and `starts`,
    the first point of each item and the end."""
    lengths = [len(item["positions"]) for item in items]
    batch = {"batch": torch.repeat_interleave(torch.arange(len(items)), torch.tensor(lengths))}
    batch["starts"] = torch.tensor([0, *np.cumsum(lengths)])
    for name, value in items[0].items():
        together = [item[name] for item in items]
        batch[name] = torch.cat(together) if torch.is_tensor(value) and value.ndim else torch.as_tensor(together)
    return batch
