"""echocast simulates depth sensors: LiDARs, depth cameras, sonars and radars in a 3D scene, every point labelled.

>>> import numpy as np
>>> import echocast as ec
>>> floor = np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], dtype=np.float32)
>>> scene = ec.Scene.from_arrays(floor, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32), name="floor")
>>> cloud = scene.scan(ec.Sensor("velodyne_vlp16"), at=(0, 0, 1.8), seed=7)
>>> bool(abs(cloud.z.mean()) < 0.01)
True

Lengths are in metres, times in seconds and angles in radians unless a name gives another unit (`rpy_deg`). Sensors look along
x; y is left and z is up. Errors are `echocast.Error`, and also the ValueError, FileNotFoundError or OSError that one would
expect.
"""

from typing import TYPE_CHECKING

from echocast._echocast import (
    Box,
    Environment,
    Image,
    LiveScene,
    Material,
    Mesh,
    Ping,
    Pings,
    PointCloud,
    Pose,
    RadarFrame,
    Sample,
    Scenario,
    Scene,
    Sensor,
    Trajectory,
    __version__,
    finish,
    formats,
    presets,
    read_cloud,
    run,
)
from echocast._errors import (
    ArgumentError,
    CancelledError,
    Error,
    FileError,
    FormatError,
    NotFoundError,
    OutOfMemoryError,
    UnsupportedError,
)

__all__ = [
    "ArgumentError",
    "Box",
    "CancelledError",
    "Environment",
    "Error",
    "FileError",
    "FormatError",
    "Image",
    "LiveScene",
    "Material",
    "Mesh",
    "NotFoundError",
    "OutOfMemoryError",
    "Ping",
    "Pings",
    "PointCloud",
    "Pose",
    "RadarFrame",
    "Sample",
    "Scenario",
    "Scene",
    "Sensor",
    "Trajectory",
    "UnsupportedError",
    "__version__",
    "finish",
    "formats",
    "presets",
    "read_cloud",
    "run",
    "show",
]

if TYPE_CHECKING:
    from echocast._look import show
else:

    def __getattr__(name):
        # What needs NumPy is imported when it is used: it would take most of the time of `import echocast`.
        if name != "show":
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from echocast._look import show

        globals()["show"] = show
        return show

    def __dir__():
        return sorted({*globals(), *__all__})
