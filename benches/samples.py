"""How fast samples of a street are made by a DataLoader of PyTorch with two workers, beside two threads of one process, and
by Ray with two workers, beside `echocast run` with two threads. Wall-clock time, rounds in turn, medians; what is not
installed is left out.

    pip install "$(echo target/python/tested-wheels/echocast-*.whl)[torch,ray]"
    python benches/samples.py --samples 600 --rounds 3
"""

import argparse
import importlib.util
import logging
import statistics
import tempfile
import time
from pathlib import Path

import echocast as ec

STREET = {
    "scene": {"files": "street.glb"},
    "sensors": [{"sensor": "velodyne_vlp32c"}],
    "trajectory": {"camera": "Corner"},
    "variation": [{"move": "Car_*", "by_m": [{"uniform": [-3, 3]}, 0, 0]}],
    "outputs": [{"style": "plain", "format": "las"}],
}


def threads(scenario, folder):
    """Seconds of a sample made by two threads of this process, without files."""
    scenario = ec.Scenario(scenario, folder=folder, threads=2)
    scenario[0].cloud()
    start = time.perf_counter()
    for sample in scenario:
        sample.cloud()
    return (time.perf_counter() - start) / len(scenario)


def loader(scenario, folder):
    """Seconds of a sample made by two workers of a DataLoader, once they have begun."""
    import torch
    from echocast.torch import ScanDataset

    data = ScanDataset(scenario, folder=folder)
    batches = iter(torch.utils.data.DataLoader(data, batch_size=4, num_workers=2, collate_fn=list))
    # Both have made a batch.
    next(batches), next(batches)
    start = time.perf_counter()
    count = sum(map(len, batches))
    return (time.perf_counter() - start) / count


def program(scenario, folder):
    """Seconds of a sample of a set made by two threads, with its files."""
    with tempfile.TemporaryDirectory(dir=folder) as output:
        done = ec.run(ec.Scenario(scenario, folder=folder), output, threads=2)
    return done["seconds"] / done["made"]


def cluster(scenario, folder):
    """Seconds of a sample of a set made by two workers of Ray, once the first has begun."""
    import echocast.ray

    begun = []
    with tempfile.TemporaryDirectory(dir=folder) as output:
        tell = lambda made, all: begun.append(time.perf_counter())
        done = echocast.ray.run(scenario, output, folder=folder, workers=2, progress=tell)
        end = time.perf_counter()
    return (end - begun[0]) / done["made"]


parser = argparse.ArgumentParser()
parser.add_argument("--samples", type=int, default=600)
parser.add_argument("--rounds", type=int, default=3)
asked = parser.parse_args()

pairs = {}
if importlib.util.find_spec("torch"):
    pairs["DataLoader"] = loader, threads
if importlib.util.find_spec("ray"):
    import ray

    ray.init(num_cpus=2, include_dashboard=False, logging_level=logging.ERROR)
    pairs["Ray"] = cluster, program

with tempfile.TemporaryDirectory() as folder:
    ec.Scene.generate("street", seed=7, cars=5, path=Path(folder, "street.glb"))
    scenario = STREET | {"samples": asked.samples}
    for name, (there, here) in pairs.items():
        rounds = [(there(scenario, folder), here(scenario, folder)) for _ in range(asked.rounds)]
        ratio = statistics.median(mine / theirs for theirs, mine in rounds)
        theirs, mine = (1000 * statistics.median(times) for times in zip(*rounds))
        print(f"{name}: {theirs:.1f} ms a sample, here {mine:.1f} ms: {ratio:.2f} of its speed", flush=True)
