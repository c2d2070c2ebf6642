"""Scans for PyTorch: the same in every worker, batches of clouds of unequal length."""

import numpy as np
import pytest

import echocast as ec

torch = pytest.importorskip("torch")
from echocast.torch import ScanDataset, collate  # noqa: E402


@pytest.fixture
def keys(tmp_path):
    (tmp_path / "tent.obj").write_text(
        "o tent\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv 0 0 2\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n"
    )
    return {
        "scene": {"files": str(tmp_path / "tent.obj")},
        "sensors": [{"sensor": "velodyne_vlp16"}],
        "trajectory": {"position_m": [4, 0, 1]},
        "variation": [{"move": "tent", "by_m": [{"uniform": [-1, 1]}, 0, 0]}],
        "samples": 6,
        "seed": 3,
    }


def test_items_are_the_samples(keys):
    data = ScanDataset(keys, columns=["range", "category_id"])
    cloud = ec.Scenario(keys)[4].cloud()
    item = data[4]
    assert len(data) == 6 and item["sample"] == 4
    assert np.array_equal(item["range"].numpy(), cloud.range) and item["category_id"].dtype == torch.int64
    assert np.allclose(torch.linalg.norm(item["positions"], dim=1).numpy(), cloud.range, atol=0.2)


@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_workers_make_the_same(keys, context):
    data = ScanDataset(keys)
    alone = list(torch.utils.data.DataLoader(data, batch_size=4, collate_fn=collate))
    loader = torch.utils.data.DataLoader(
        data, batch_size=4, num_workers=2, collate_fn=collate, multiprocessing_context=context
    )
    for one, other in zip(alone, loader, strict=True):
        assert all(torch.equal(one[name], other[name]) for name in one)
    first = alone[0]
    assert first["starts"][-1] == len(first["positions"]) == len(first["batch"]) and first["sample"].tolist() == [0, 1, 2, 3]


def test_epochs_differ_if_they_are_to(keys):
    data = ScanDataset(keys, samples=[2], epochs_differ=True, transform=lambda item: item["positions"])
    first = data[0]
    data.set_epoch(1)
    assert not torch.equal(first[:100], data[0][:100])
    data.set_epoch(0)
    assert torch.equal(first, data[0])
    same = ScanDataset(keys, samples=[2], transform=lambda item: item["positions"])
    same.set_epoch(1)
    assert torch.equal(first, same[0])
