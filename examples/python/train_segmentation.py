"""Trains a small network that finds what points of a street belong to, on streets that are made while it learns.

    pip install "$(echo target/python/tested-wheels/echocast-*.whl)[torch]"
    python examples/python/train_segmentation.py --seconds 60

Every sample is another street and is seen once. The streets that the network is judged by are none of those. Fails if
what it knows of them has not risen.
"""

import argparse
import sys
import time

import torch
from torch import nn

from echocast.torch import ScanDataset, ScanStream, collate

# The classes, each with its categories of a generated street.
CLASSES = {
    "ground": ["road", "lane-marking", "parking", "sidewalk", "terrain"],
    "building": ["building", "fence"],
    "vehicle": ["car", "truck", "bicycle"],
    "person": ["person"],
    "plant": ["vegetation", "trunk"],
    "post": ["pole", "traffic-sign", "other-object"],
}
NAMES = [name for names in CLASSES.values() for name in names]
# Class by category number, from 1; 0 is unlabelled and ignored in training.
NONE = -1
CLASS = torch.tensor([NONE] + [place for place, names in enumerate(CLASSES.values()) for _ in names])

STREETS = {
    "scene": {
        "generate": {"street": {"cars": 6, "people": 8}, "seed": 0},
        # Categories have the same numbers in all streets, whichever of them a street has.
        "labels": {"numbers": {name: number for number, name in enumerate(NAMES, 1)}},
    },
    "sensors": [{"sensor": "velodyne_vlp16"}],
    "trajectory": {"on": {"category": "road"}, "height_m": 1.9, "turn_deg": {"uniform": [0, 360]}, "clearance_m": 1},
    "variation": [{"set": "scene.generate.seed", "to": {"uniform": [1, 1000000]}}],
    "samples": 72,
    "seed": 1,
}
LEARNT, HELD_OUT = range(64), range(64, 72)


def prepared(item):
    """Every third point, which is enough to learn from, with its class instead of its category."""
    points = {name: value[::3] for name, value in item.items() if name != "sample"}
    points["class"] = CLASS[points.pop("category_id")]
    return points


def layer(width, out):
    return nn.Linear(width, out), nn.LayerNorm(out), nn.ReLU()


class Pillars(nn.Module):
    """A class for each point, out of what it is itself and what stands in the upright pillars around it."""

    SIZES = (0.4, 1.6, 6.4)  # m

    def __init__(self, width=48):
        super().__init__()
        self.points = nn.Sequential(*layer(7, width), *layer(width, width))
        wide = width * (1 + len(self.SIZES))
        self.head = nn.Sequential(*layer(wide, 2 * width), *layer(2 * width, width), nn.Linear(width, len(CLASSES)))

    def forward(self, batch):
        positions = batch["positions"]
        middles = (positions[:, :2] / self.SIZES[0]).floor().add(0.5) * self.SIZES[0]
        height = positions[:, 2:]
        distance = positions.norm(dim=1, keepdim=True)
        inside = (positions[:, :2] - middles) / self.SIZES[0]
        shape = [height / 2, -height / 2, distance / 20, inside, batch["intensity"][:, None] / 255, height / distance]
        points = self.points(torch.cat(shape, dim=1))
        return self.head(torch.cat([points, *(pooled(points, batch, size) for size in self.SIZES)], dim=1))


def pooled(points, batch, size):
    """For each point, the largest of each feature in its pillar of `size` m."""
    pillars = torch.cat([batch["batch"][:, None], (batch["positions"][:, :2] / size).floor().long()], dim=1)
    # One number for each pillar, which is faster to sort than three.
    pillars = (pillars[:, 0] * 4096 + pillars[:, 1] + 2048) * 4096 + pillars[:, 2] + 2048
    numbers, pillar = pillars.unique(return_inverse=True)
    largest = points.new_zeros(len(numbers), points.shape[1])
    # Features are at least 0.
    return largest.scatter_reduce(0, pillar[:, None].expand_as(points), points, "amax")[pillar]


@torch.no_grad()
def judge(network, batches):
    """Share of points whose class is found, and the mean over classes of intersection over union."""
    counts = torch.zeros(len(CLASSES), len(CLASSES))
    for batch in batches:
        known = batch["class"] != NONE
        pairs = batch["class"][known] * len(CLASSES) + network(batch).argmax(dim=1)[known]
        counts += pairs.bincount(minlength=counts.numel()).view_as(counts)
    right = counts.diagonal()
    union = counts.sum(dim=0) + counts.sum(dim=1) - right
    return (right.sum() / counts.sum()).item(), (right / union)[union > 0].mean().item()


def main():
    parser = argparse.ArgumentParser(description="Trains a small segmentation network on made streets.")
    parser.add_argument("--seconds", type=float, default=60, help="how long it learns (60)")
    parser.add_argument("--workers", type=int, default=2, help="processes that make streets (2)")
    options = parser.parse_args()

    torch.manual_seed(1)
    load = {"batch_size": 2, "num_workers": options.workers, "collate_fn": collate}
    held_out = list(torch.utils.data.DataLoader(ScanDataset(STREETS, HELD_OUT, prepared), **load))
    stream = ScanStream(STREETS, LEARNT, prepared, shuffle=True, epochs_differ=True)
    loader = torch.utils.data.DataLoader(stream, **load, persistent_workers=options.workers > 0)

    network = Pillars()
    optimiser = torch.optim.AdamW(network.parameters(), lr=3e-3)
    before = after = judge(network, held_out)
    seen = torch.cat([batch["class"] for batch in held_out])
    commonest = (seen[seen != NONE].bincount().max() / (seen != NONE).sum()).item()
    print(f"held-out streets: {len(HELD_OUT)}, in which the commonest class alone would be right for {commonest:.3f}")
    print(f"before: accuracy {before[0]:.3f}, mean IoU {before[1]:.3f}", flush=True)
    start, streets, epoch = time.monotonic(), 0, 0
    while (spent := time.monotonic() - start) < options.seconds:
        stream.set_epoch(epoch)
        for batch in loader:
            loss = nn.functional.cross_entropy(network(batch), batch["class"], ignore_index=NONE)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            streets += len(batch["starts"]) - 1
            if (spent := time.monotonic() - start) >= options.seconds:
                break
        epoch += 1
        after = judge(network, held_out)
        print(f"{spent:.0f} s, {streets} streets: accuracy {after[0]:.3f}, mean IoU {after[1]:.3f}", flush=True)
    if not (after[0] > before[0] and after[1] > before[1]):
        sys.exit("the network has learnt nothing: accuracy and mean IoU on held-out streets must rise")


if __name__ == "__main__":
    main()
