"""Clouds as bytes: in NPZ, which holds everything a cloud has."""

import tempfile
from pathlib import Path

from echocast import _echocast


def to_bytes(cloud: _echocast.PointCloud) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "cloud.npz")
        cloud.write(path)
        return path.read_bytes()


def from_bytes(data: bytes) -> _echocast.PointCloud:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "cloud.npz")
        path.write_bytes(data)
        return _echocast.PointCloud.read(path)
