"""The cluster that this process is connected to."""

import ray


def workers(asked: int | None) -> int:
    """How many workers a run has: `asked`, or one for each CPU of the cluster. Without one, one of this machine alone is
    begun."""
    if not ray.is_initialized():
        ray.init()
    return asked or max(1, int(ray.cluster_resources().get("CPU", 1)))
