"""Reads files of sonar pings and of their images with readers that have nothing to do with echocast, prints JSON.

usage: pings.py FILE...

One list element per file: for each array its type, shape and values as text, row by row.
"""

import json
import sys

import h5py
import numpy


def arrays(path):
    if path.endswith(".npz"):
        with numpy.load(path) as file:
            return dict(file)
    with h5py.File(path) as file:
        for name, dataset in file.items():
            text = h5py.check_string_dtype(dataset.dtype)
            assert text or name.endswith("_ids") or dataset.attrs["meaning"], name
        read = {k: d.asstr()[()] if h5py.check_string_dtype(d.dtype) else d[()] for k, d in file.items()}
        return {name: numpy.asarray(value) for name, value in read.items()}


def plain(array):
    text = array.dtype.kind in "UO"
    kind = "text" if text else array.dtype.str.lstrip("<|")
    values = [str(value) if text else repr(value) for value in array.ravel().tolist()]
    return {"type": kind, "shape": list(array.shape), "values": values}


json.dump([{name: plain(array) for name, array in arrays(path).items()} for path in sys.argv[1:]], sys.stdout)
