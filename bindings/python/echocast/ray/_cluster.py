"""The cluster that this process is connected to."""

import ray


def connected(workers: int | None) -> int:
    """How many workers a run has, as asked for or one for each CPU; connects to a cluster of this machine alone if there is
    none yet."""
    if not ray.is_initialized():
        ray.init()
    return workers or max(1, int(ray.cluster_resources().get("CPU", 1)))
