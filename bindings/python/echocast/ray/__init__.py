"""Sets and training data made on a Ray cluster. Needs the package `ray[data]`.

    import echocast.ray

    echocast.ray.run("drive.yaml", "s3://bucket/set")
    for batch in echocast.ray.dataset("drive.yaml").iter_batches(batch_size=4):
        batch["positions"][0], batch["category_id"][0]

Ray schedules, retries and moves data; this module adds only what a set needs beyond that. The files are identical, byte for
byte, to those of `echocast run` on one machine.
"""

from echocast._convert import package

package("ray", "'ray[data]'")

from echocast.ray._dataset import dataset  # noqa: E402
from echocast.ray._run import run  # noqa: E402

__all__ = ["dataset", "run"]
