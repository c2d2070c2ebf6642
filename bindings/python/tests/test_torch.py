"""Scans for PyTorch: the same in every worker, batches of clouds of unequal length."""

import functools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import echocast as ec

torch = pytest.importorskip("torch")
from torch.utils.data import DataLoader  # noqa: E402

from echocast.torch import ScanDataset, ScanStream, collate  # noqa: E402


@pytest.fixture
def keys(tent: Path) -> dict[str, Any]:
    return {
        "scene": {"files": str(tent)},
        "sensors": [{"sensor": "velodyne_vlp16"}],
        "trajectory": {"position_m": [4, 0, 1]},
        "variation": [{"move": "tent", "by_m": [{"uniform": [-1, 1]}, 0, 0]}],
        "samples": 6,
        "seed": 3,
    }


def middle(item: dict[str, Any]) -> tuple[int, list[float]]:
    """Of a sample, its number and where its points are, on average."""
    return item["sample"], item["positions"].mean(dim=0).tolist()


def seen(loader: Any) -> dict[int, list[float]]:
    """Batches of one item as a dict: sample to middle."""
    return dict(item for batch in loader for item in batch)


# Loaders of single samples; `list` keeps them as they are.
Loader = functools.partial(DataLoader, collate_fn=list)


def test_items_are_the_samples(keys: dict[str, Any]) -> None:
    scenario = ec.Scenario(keys)
    data = ScanDataset(scenario, columns=["range", "category_id"])
    cloud = scenario[4].cloud()
    item = data[4]
    assert len(data) == 6 and item["sample"] == 4
    assert np.array_equal(item["range"].numpy(), cloud.range) and item["category_id"].dtype == torch.int64
    assert np.allclose(torch.linalg.norm(item["positions"], dim=1).numpy(), cloud.range, atol=0.2)


@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_workers_make_the_same(keys: dict[str, Any], context: str) -> None:
    data = ScanDataset(keys)
    alone = list(DataLoader(data, batch_size=4, collate_fn=collate))
    loader = DataLoader(data, batch_size=4, num_workers=2, collate_fn=collate, multiprocessing_context=context)
    for one, other in zip(alone, loader, strict=True):
        assert all(torch.equal(one[name], other[name]) for name in one)
    first = alone[0]
    assert first["starts"][-1] == len(first["positions"]) == len(first["batch"])
    assert first["sample"].tolist() == [0, 1, 2, 3]
    assert torch.equal(first["batch"].bincount(), first["starts"].diff())


def test_epochs_differ_if_they_are_to(keys: dict[str, Any]) -> None:
    data = ScanDataset(keys, samples=[2], epochs_differ=True, transform=lambda item: item["positions"])
    first = data[0]
    data.set_epoch(1)
    assert not torch.equal(first[:100], data[0][:100])
    data.set_epoch(0)
    assert torch.equal(first, data[0])
    same = ScanDataset(keys, samples=[2], transform=lambda item: item["positions"])
    same.set_epoch(1)
    assert torch.equal(first, same[0])


def test_no_epoch_is_that_of_a_seed_nearby(keys: dict[str, Any]) -> None:
    data, other = (ScanDataset({**keys, "seed": seed}, transform=middle, epochs_differ=True) for seed in (3, 4))
    data.set_epoch(1)
    assert data[0] != other[0]


@pytest.mark.parametrize("context", ["fork", "spawn"])
@pytest.mark.parametrize("kind", [ScanDataset, ScanStream])
def test_workers_that_live_on_are_told_of_epochs(keys: dict[str, Any], kind: Any, context: str) -> None:
    data = kind(keys, transform=middle, epochs_differ=True)
    loader = Loader(data, num_workers=2, persistent_workers=True, multiprocessing_context=context)
    alone = Loader(data)
    epochs = []
    for epoch in (0, 1, 0):
        data.set_epoch(epoch)
        epochs.append(seen(loader))
        assert epochs[-1] == seen(alone)
    assert epochs[0] == epochs[2] and all(epochs[0][sample] != epochs[1][sample] for sample in range(6))


@pytest.mark.parametrize("workers", [0, 1, 2, 4])
def test_a_stream_has_each_sample_once(keys: dict[str, Any], workers: int) -> None:
    stream = ScanStream(keys, transform=middle, shuffle=True)
    orders = []
    for epoch in (0, 1):
        stream.set_epoch(epoch)
        orders.append([batch[0][0] for batch in Loader(stream, num_workers=workers)])
        assert sorted(orders[-1]) == list(range(6))
    assert orders[0] != orders[1]
    # The order changes what is drawn in no way.
    assert seen(Loader(stream)) == seen(Loader(ScanDataset(keys, transform=middle)))


def rank(number: int, ranks: int, keys: dict[str, Any], told: Any, folder: Path) -> None:
    torch.distributed.init_process_group("gloo", init_method=f"file://{folder}/ranks", rank=number, world_size=ranks)
    stream = ScanStream(keys, [0, 1, 2, 3, 4], transform=middle, shuffle=True)
    for context in ("fork", "spawn"):
        loader = Loader(stream, num_workers=2, multiprocessing_context=context)
        told.put((context, number, [batch[0][0] for batch in loader]))
    torch.distributed.destroy_process_group()


@pytest.mark.skipif(not torch.distributed.is_available(), reason="this PyTorch has no torch.distributed")
def test_ranks_share_a_stream(keys: dict[str, Any], tmp_path: Path) -> None:
    told = torch.multiprocessing.get_context("spawn").SimpleQueue()
    torch.multiprocessing.spawn(rank, (2, keys, told, tmp_path), nprocs=2)
    parts = {(context, number): samples for context, number, samples in (told.get() for _ in range(4))}
    for context in ("fork", "spawn"):
        one, other = parts[context, 0], parts[context, 1]
        assert len(one) == len(other) == 3 and set(one) | set(other) == {0, 1, 2, 3, 4}
