"""The cluster that this process is connected to."""

import ray


def workers(asked: int | None) -> int:
    """The number of workers of a run: `asked`, or one for each CPU of the cluster. Without a cluster, one of this machine
    alone is started."""
    if not ray.is_initialized():
        ray.init()
    return asked or max(1, int(ray.cluster_resources().get("CPU", 1)))
