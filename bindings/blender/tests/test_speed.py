"""A million triangles: how fast they are read, and a second scan begins. The limits leave room for busy machines."""

import time

import bpy
import numpy as np
import pytest

from echocast_blender import scene


def seconds() -> float:
    since = time.perf_counter()
    scene.exported(bpy.context)
    return time.perf_counter() - since


@pytest.mark.parametrize("smooth", [False, True])
def test_a_million_triangles(smooth: bool) -> None:
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=710, y_subdivisions=710, size=100)
    grid = bpy.context.object
    places = np.empty(3 * len(grid.data.vertices), dtype=np.float32)
    grid.data.vertices.foreach_get("co", places)
    places[2::3] = np.sin(places[0::3])
    grid.data.vertices.foreach_set("co", places)
    grid.data.polygons.foreach_set("use_smooth", np.full(len(grid.data.polygons), smooth))
    grid.data.update()
    bpy.ops.mesh.primitive_cube_add(location=(0, 0, 5))
    cube = bpy.context.object
    anew = []
    for _ in range(3):
        scene.EXPORTED.clear()
        anew.append(seconds())
    first = min(anew)
    exported = scene.exported(bpy.context)
    exported.live.scan("velodyne_vlp16", at=(0, 0, 4))
    again = []
    for step in range(5):
        cube.location.x = step + 1.0
        since = time.perf_counter()
        scene.exported(bpy.context).live.scan({"name": "one", "kind": "lidar", "pattern": {"type": "pinhole", "resolution": [1, 1], "fov_deg": [1, 1]}}, at=(0, 0, 4))
        again.append(time.perf_counter() - since)
    print(f"\n{bpy.app.version_string}: read {1e3 * first:.0f} ms, smooth {smooth}; again {1e3 * np.median(again):.1f} ms, most {1e3 * max(again):.1f}")
    assert first < 2.5
    assert np.median(again) < 0.15
