"""Converts clouds to the types of other packages; each is imported when it is needed."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from echocast._echocast import PointCloud

if TYPE_CHECKING:
    from echocast._echocast import Array


def package(name: str, install: str) -> Any:
    """The module `name`; if it is missing, the error says how to install it."""
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"this needs the package {name}, which is not installed; pip install {install}") from error


def to_dict(cloud: PointCloud) -> "dict[str, Array]":
    """Columns by name, without copies; positions are relative to `cloud.origin`."""
    return {name: cloud[name] for name in cloud.fields}


def to_pandas(cloud: PointCloud) -> Any:
    """A pandas.DataFrame of all columns; `x`, `y` and `z` relative to `cloud.origin`, which is in its `attrs`."""
    frame = package("pandas", "pandas").DataFrame(to_dict(cloud), copy=False)
    frame.attrs["origin"] = tuple(cloud.origin)
    frame.attrs["categories"] = cloud.categories
    return frame


def to_torch(cloud: PointCloud, columns: Sequence[str] | None = None) -> dict[str, Any]:
    """Tensors by name that own their memory: integers as int64, which networks use for classes."""
    torch = package("torch", "torch")
    tensors = {}
    for name in columns or cloud.fields:
        column = cloud[name]
        tensors[name] = torch.from_numpy(column.astype(np.int64) if column.dtype.kind == "u" else column.copy())
    return tensors


def to_open3d(cloud: PointCloud) -> Any:
    """An open3d.t.geometry.PointCloud with all columns, positions relative to `cloud.origin`."""
    o3d = package("open3d", "open3d")
    made = o3d.t.geometry.PointCloud(o3d.core.Tensor(cloud.xyz))
    for name in cloud.fields:
        if name not in ("x", "y", "z"):
            column = cloud[name]
            wide = {"u2": np.int32, "u4": np.int64}.get(column.dtype.str[1:], column.dtype)
            made.point[name] = o3d.core.Tensor(np.ascontiguousarray(column.astype(wide))[:, None])
    return made


def records(cloud: PointCloud) -> "np.recarray[Any, Any]":
    """All points, each with a member for each column."""
    return structured(cloud).view(np.recarray)


def structured(cloud: PointCloud, dtype: Any = None, copy: bool | None = None) -> "Array":
    """A structured array with a member for each column; a copy."""
    if copy is False:
        raise ValueError("an array of all columns is a copy; for one without, take a column: cloud.range")
    array = np.empty(len(cloud), [(name, cloud[name].dtype) for name in cloud.fields])
    for name in cloud.fields:
        array[name] = cloud[name]
    return array if dtype is None else array.astype(dtype)
