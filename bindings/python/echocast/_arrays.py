"""Converts arguments to arrays of the types that the extension module reads, and to text."""

import json
import os
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from echocast._errors import ArgumentError

if TYPE_CHECKING:
    from echocast._echocast import Array


def numbers(name: str, value: Any, dtype: "np.dtype[Any]", dimensions: int | None, shape: str) -> "Array":
    """The argument `name` as a copy of the type `dtype`, with `dimensions`, None: any number. `shape` states what is
    allowed. Whole numbers are accepted where fractions are, but not the other way round."""
    array = as_array(name, value, shape)
    whole = dtype.kind == "u"
    if array.size == 0:
        array = array.astype(dtype)
    if array.dtype.kind not in ("iu" if whole else "iuf"):
        raise TypeError(f"{name} is {found(value, array)}; allowed: {shape} {'whole ' if whole else ''}numbers")
    if dimensions is not None and array.ndim != dimensions:
        raise ArgumentError(f"{name} is {shown(array.shape)}; allowed: {shape}")
    if whole and array.size:
        most = np.iinfo(dtype).max
        for wrong in array[(array < 0) | (array > most)].flat:
            raise ArgumentError(f"{name} has the number {wrong}; allowed: 0 to {most}")
    # What float32 cannot hold is infinite, which is refused as such.
    with np.errstate(over="ignore"):
        return array.astype(dtype)


def rows(key: Any) -> "npt.NDArray[np.int64 | np.bool_]":
    """The mask or the row numbers that `cloud[key]` selects."""
    allowed = "the name of a column, the number of a point, a slice, a mask (bool), or row numbers (int)"
    array = as_array("the key of a cloud", key, allowed)
    if array.ndim == 1 and array.dtype.kind == "b":
        return array
    if array.ndim == 1 and (array.dtype.kind in "iu" or array.size == 0):
        # No number beyond int64 is a valid row.
        return np.minimum(array, np.uint64(2**63 - 1)).astype(np.int64) if array.dtype == np.uint64 else array.astype(np.int64)
    raise TypeError(f"the key of a cloud is {found(key, array)}; allowed: {allowed}")


def as_array(name: str, value: Any, shape: str) -> "Array":
    try:
        return np.asarray(value)
    except ValueError as error:
        raise ArgumentError(f"{name} has rows of different lengths; allowed: {shape}") from error


def found(value: Any, array: "Array") -> str:
    """A description of `value`, which NumPy has converted to `array`."""
    kind = type(value).__name__
    if array.dtype.kind in "OUS" and isinstance(value, list | tuple):
        return f"a {kind} of other things than numbers"
    if array.dtype.kind in "OUS" or array.ndim == 0:
        return f"of the type {kind}"
    return f"an array of {array.dtype}, {shown(array.shape)}"


def check_type(name: str, value: Any, types: "type | tuple[type, ...]", allowed: str) -> None:
    """Fails unless the argument `name` is None or of one of `types`."""
    if value is not None and not isinstance(value, types):
        raise TypeError(f"{name} is of the type {type(value).__name__}; allowed: {allowed}")


def shown(shape: tuple[int, ...]) -> str:
    """The shape of an array as text: 3 x 4."""
    return " x ".join(map(str, shape)) if len(shape) > 1 else f"{shape[0]} long" if shape else "one number"


def text(value: Any) -> str:
    """Keys and values as JSON, which is YAML too."""
    try:
        return json.dumps(value, default=plain)
    except TypeError as error:
        raise TypeError(odd(value, "") or str(error)) from None


def odd(value: Any, name: str) -> str | None:
    """What is wrong with the first thing within `value` that JSON does not support; `name` is what messages call `value`."""
    if isinstance(value, dict):
        parts = [(f"{name}.{key}" if name else str(key), item) for key, item in value.items()]
    elif isinstance(value, list | tuple):
        parts = [(f"{name}[{index}]", item) for index, item in enumerate(value)]
    elif value is None or isinstance(value, str | bool | int | float | np.ndarray | np.generic | os.PathLike):
        return None
    else:
        return f"{name or 'a value'} is of the type {type(value).__name__}; allowed: numbers, texts, lists and dicts"
    return next(filter(None, (odd(item, part) for part, item in parts)), None)


def plain(value: Any) -> Any:
    """NumPy's numbers and arrays, and paths, as types that JSON supports."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"a value is of the type {type(value).__name__}; allowed: numbers, texts, lists and dicts")
