"""Common code of the training data for PyTorch and for Ray."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from echocast._echocast import PointCloud, Scenario

if TYPE_CHECKING:
    from echocast._echocast import Keys, Path


#: Columns that items have by default.
COLUMNS = ("intensity", "category_id")


def positions(cloud: PointCloud) -> npt.NDArray[np.float32]:
    """Positions relative to the sensor's position at the start of the scan: n x 3 float32, m; a copy."""
    xyz = cloud.xyz
    place = np.asarray(cloud.origin) - (cloud.sensor_pose.position if cloud.coordinates == "world" else 0)
    xyz += place.astype(np.float32)
    return xyz


def source(scenario: "Scenario | Keys", folder: "Path") -> "tuple[Keys, Path]":
    """What other processes load the scenario from, and the folder of its files; `scenario` may be an echocast.Scenario."""
    if not isinstance(scenario, Scenario):
        return scenario, folder
    # A copy; this fails if a folder is given.
    copy = Scenario(scenario, folder=folder)
    return copy.to_yaml(), copy.folder
