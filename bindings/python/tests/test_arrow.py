"""Clouds for Arrow, without copies."""

import gc
import json

import numpy as np
import pytest

import echocast as ec


def test_tables_share_the_memory_of_the_cloud(room: ec.Scene, cloud: ec.PointCloud) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    table = pyarrow.table(cloud)
    assert table.column_names == cloud.fields and table.num_rows == len(cloud)
    for name in cloud.fields:
        column = table[name].chunk(0)
        assert np.array_equal(column.to_numpy(), cloud[name], equal_nan=True)
        assert column.buffers()[1].address == cloud[name].__array_interface__["data"][0]
    assert json.loads(table.schema.metadata[b"categories"]) == {"40": "road", "50": "building"}
    assert json.loads(table.schema.metadata[b"origin"]) == cloud.origin
    # It keeps the cloud alive.
    table = pyarrow.table(room.scan("velodyne_vlp16", at=(0, 0, 1.8), seed=7))
    gc.collect()
    assert np.array_equal(table["range"].to_numpy(), cloud.range)


def test_polars_reads_it(cloud: ec.PointCloud) -> None:
    polars = pytest.importorskip("polars")
    frame = polars.DataFrame(cloud)
    assert frame.columns == cloud.fields and np.array_equal(frame["range"].to_numpy(), cloud.range)


def test_an_empty_cloud_is_a_table(cloud: ec.PointCloud) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    assert pyarrow.table(cloud[:0]).num_rows == 0
