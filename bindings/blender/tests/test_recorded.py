"""Scenes scanned with the paper's system (BLAINDER range scanner 7842360 in Blender 3.4.1), with its settings taken over: the
same points. The recordings are in `reference/scans` of the folder that ECHOCAST_SHARED names, else of `shared` beside the
repository; without them these tests are skipped."""

import csv
import gzip
import json
import os
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from echocast_blender import paper, scan

SHARED = Path(os.environ.get("ECHOCAST_SHARED", Path(__file__).resolve().parents[4] / "shared"))
SCANS = SHARED / "reference" / "scans"

pytestmark = pytest.mark.skipif(not SCANS.is_dir(), reason="there are no recorded scans; ECHOCAST_SHARED names where they are")


def load(case: str, scene: str) -> "tuple[dict[str, Any], Any, Any]":
    """Loads the scene with the settings of the paper's add-on; returns the description of the recording, its columns, and
    the sensor."""
    about = json.loads((SCANS / f"{case}.json").read_text())
    with gzip.open(SCANS / f"{case}.csv.gz", "rt") as file:
        rows = list(csv.DictReader(file, delimiter=";"))
    columns = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    if not hasattr(np, "bool"):
        # What the importer of Blender 3.4 uses is gone from later NumPys of 1.x.
        np.bool = np.bool_
    bpy.ops.import_scene.gltf(filepath=str(SCANS / scene))
    timeline = bpy.context.scene
    # Their materials have the reflectance in a property, where the add-on read the alpha of the colour.
    camera = bpy.data.objects.new("Scanner", bpy.data.cameras.new("Scanner"))
    timeline.collection.objects.link(camera)
    camera.matrix_world = Matrix(about["sensor"]["matrix_world"])
    kinds = {"static": paper.STATIC, "rotating": paper.ROTATING}
    stored = {key: value for key, value in about["parameters"].items() if key in paper.DEFAULTS}
    timeline[paper.GROUP] = {**stored, "scannerType": kinds[about["scanner"]]}
    timeline[paper.GROUP]["scannerObject"] = camera
    told = paper.take_over(timeline)
    assert told and camera.echocast.is_sensor and timeline.echocast.profile == "blainder"
    return about, columns, camera


@pytest.mark.parametrize(
    ("case", "scene"),
    [("a_quad_10x10", "a_quad.glb"), ("a_quad_100x100", "a_quad.glb"), ("e_chairs", "e_chairs.glb"), ("f_mirror_rotating", "f_mirror.glb")],
)
def test_the_settings_of_the_paper_give_its_points(case: str, scene: str) -> None:
    about, recorded, camera = load(case, scene)
    bpy.context.scene.echocast.columns = "all"
    frame = scan.prepare(bpy.context, bpy.context.scene.frame_current)
    (result,) = scan.run(frame, lambda fraction: True)
    cloud = result.cloud
    # Single rays along edges may differ.
    assert abs(len(cloud) - about["points"]) <= max(2, about["points"] // 1000)
    assert len(recorded["X"]) == about["points"]
    ours = cloud.xyz.astype(float) + cloud.origin
    theirs = np.stack([recorded[axis] for axis in "XYZ"], axis=1)
    # The nearest of ours for each of theirs, by voxels of 5 mm and their neighbours.
    matched = nearest(ours, theirs)
    tolerance = 3e-3 if "mirror" in case else 1e-3
    near = np.linalg.norm(ours[matched] - theirs, axis=1) < tolerance
    assert near.mean() > 0.998, f"{(~near).sum()} of {len(near)}"
    # A point seen in a mirror has the mirror's labels there; here it has those of what is seen.
    direct = near & (cloud.bounces[matched] == 0)
    for column, table, kind in (("category_id", cloud.categories, "categoryID"), ("part_id", cloud.parts, "partID")):
        known = {number: name for name, number in about["labels"][kind].items()}
        expected = np.array([known[int(number)] for number in recorded[kind]])
        found = np.array([table.get(int(number), "") for number in cloud[column][matched]])
        assert (found == expected)[direct].mean() > 0.998, column
    first = [cloud.categories.get(number) for number in cloud.first_category_id[matched][near & ~direct]]
    assert set(first) <= {"mirror"} and len(first) > (1000 if "mirror" in case else -1)
    assert (np.abs(cloud.intensity[matched] - recorded["intensity"]) < 1e-4)[near].mean() > 0.998


def nearest(ours: Any, theirs: Any) -> Any:
    """Index of the nearest of `ours` for each of `theirs`, in a small k-d tree of Blender."""
    from mathutils.kdtree import KDTree

    tree = KDTree(len(ours))
    for index, place in enumerate(ours):
        tree.insert(place, index)
    tree.balance()
    return np.array([tree.find(place)[1] for place in theirs])
