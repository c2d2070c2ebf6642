"""Scenes of objects, generated scenes, and what moves."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import echocast as ec

SQUARE = np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]], dtype=np.float32)
TWO = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)


def places(cloud: ec.PointCloud, category: int) -> Any:
    part = cloud[cloud.category_id == category]
    return part.x + part.origin[0]


def test_scenes_are_made_of_objects() -> None:
    turned = np.array([[1.0, 0, 0, 5], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    scene = ec.Scene.from_objects(
        [
            dict(name="a", vertices=SQUARE, triangles=TWO, pose=(4, -2, 0), category="sign"),
            dict(name="b", vertices=SQUARE, triangles=TWO, pose=turned, category=1, instance=9),
            dict(vertices=SQUARE, triangles=TWO, pose=ec.Pose((6, 3, 0)), category="wall"),
        ],
        names={3: "wall"},
    )
    # "sign" does not take the number 1, which an object has.
    assert scene.objects == ["a", "b", "mesh"] and scene.categories == {2: "sign", 3: "wall"}
    cloud = scene.scan("velodyne_vlp16", at=(0, 0, 0))
    assert {id: round(float(np.median(places(cloud, id)))) for id in (1, 2, 3)} == {1: 5, 2: 4, 3: 6}
    assert cloud.instances == {1: "a", 3: "mesh", 9: "b"} and set(cloud.instance_id) == {1, 3, 9} and cloud.boxes is None
    with pytest.raises(ec.ArgumentError, match="4 x 4"):
        ec.Scene.from_objects([dict(vertices=SQUARE, triangles=TWO, pose=np.eye(3))])
    with pytest.raises((KeyError, TypeError)):
        ec.Scene.from_objects([dict(vertices=SQUARE)])  # type: ignore[typeddict-item]
    with pytest.raises(ec.ArgumentError, match="a key of object 0 is 'catgory'; allowed: vertices, .*, category"):
        ec.Scene.from_objects([dict(vertices=SQUARE, triangles=TWO, catgory="x")])  # type: ignore[typeddict-unknown-key]


def test_copies_are_objects_by_themselves() -> None:
    live = ec.LiveScene()
    first = live.add(SQUARE, TWO, pose=(4, -3, 0), name="sign", category=7, instance=1)
    second = live.add_copy(first, pose=(5, 3, 0), instance=2)
    third = live.add_copy(first, name="wall", category=8, instance=3, pose=(6, 0, 0), fixed=True)
    assert live.objects == {first: "sign", second: "sign", third: "wall"}
    cloud = live.scan("velodyne_vlp16")
    assert set(cloud.instance_id) == {1, 2, 3} and set(cloud.category_id) == {7, 8}
    assert [round(float(np.median(cloud.x[cloud.instance_id == id]))) for id in (1, 2, 3)] == [4, 5, 6]
    with pytest.raises(ec.ArgumentError):
        live.add_copy(99)
    # Arrays that are passed twice are one mesh, whatever is done to one of its objects.
    scene = ec.Scene.from_objects(
        [dict(vertices=SQUARE, triangles=TWO, pose=(4, -3, 0)), dict(vertices=SQUARE, triangles=TWO, pose=(5, 3, 0))]
    )
    live = ec.LiveScene()
    first, second = live.add_scene(scene)
    live.set_vertices(first, SQUARE - np.array([1, 0, 0], np.float32))
    cloud = live.scan("velodyne_vlp16")
    assert [round(float(np.median(cloud.x[cloud.instance_id == id]))) for id in (1, 2)] == [3, 5]


def test_what_looks_alike_shares_a_mesh() -> None:
    """Of a mesh of 1.4 MB, 200 that share nothing would take 290 MB."""
    code = """if True:
        import resource
        import numpy as np
        import echocast as ec
        x, y = np.meshgrid(np.arange(200, dtype=np.float32), np.arange(200, dtype=np.float32))
        vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(40_000, np.float32)])
        corner = np.arange(39_800, dtype=np.uint32)[np.arange(39_800) % 200 < 199]
        triangles = np.concatenate([np.column_stack([corner, corner + 1, corner + far]) for far in (200, 201)])
        def peak():
            return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        live = ec.LiveScene(threads=1)
        first = live.add(vertices, triangles)
        before = peak()
        for _ in range(200):
            live.add_copy(first)
        copies = peak() - before
        # Of other types, too, which are converted.
        vertices, triangles = vertices.astype(float), triangles.astype(np.int64)
        scene = ec.Scene.from_objects([dict(vertices=vertices, triangles=triangles)] * 200)
        print(len(live.objects), len(scene.objects), copies, peak() - before - copies)
    """
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert told.returncode == 0, told.stderr
    added, together, *kilobytes = map(int, told.stdout.split())
    assert (added, together) == (201, 200) and max(kilobytes) < 50_000, kilobytes


def test_scans_see_what_their_mask_names() -> None:
    live = ec.LiveScene()
    near = live.add(SQUARE, TWO, pose=(4, 0, 0), category=1, mask=1)
    live.add_copy(near, pose=(5, 3, 0), category=2)
    live.add_copy(near, pose=(5, -3, 0), category=3, mask=2)
    live.add(SQUARE, TWO, pose=(-5, 0, 0), category=4)

    def seen(mask: int | None) -> set[int]:
        return set(live.scan("velodyne_vlp16", mask=mask).category_id.tolist())

    assert [seen(mask) for mask in (1, 2, 4, None)] == [{1, 2, 4}, {3, 4}, {4}, {1, 2, 3, 4}]


def test_scenes_are_generated(tmp_path: Path) -> None:
    scene = ec.Scene.generate("indoor", seed=3, rooms=[1, 1], path=tmp_path / "room.glb")
    assert scene.triangles == ec.Scene.load(tmp_path / "room.glb").triangles > 100
    assert scene.categories and scene.cameras
    assert len(scene.scan("velodyne_vlp16", at=scene.camera(scene.cameras[0]))) > 1000
    with pytest.raises(ec.FormatError, match="roms"):
        ec.Scene.generate("indoor", roms=[1, 1])
    with pytest.raises(ec.FormatError, match="seebed"):
        ec.Scene.generate("seebed")  # type: ignore[arg-type]


def test_objects_move_during_a_scan() -> None:
    live = ec.LiveScene()
    number = live.add(SQUARE, TWO, category=7, instance=1, name="door")
    live.name_label("category", 7, "door")
    poses = np.stack([np.eye(4), np.eye(4)])
    poses[:, 0, 3] = [5, 7]
    live.set_motion(number, [0.0, 1.0], poses)
    for time, x in [(0.0, 5), (0.5, 6), (2.0, 7)]:
        live.set_time(time)
        cloud = live.scan("velodyne_vlp16", at=(0, 0, 0))
        assert abs(np.median(places(cloud, 7)) - x) < 0.05
    assert cloud.categories == {7: "door"} and live.objects == {number: "door"}
    live.set_labels(number, category=8, instance=2)
    assert set(live.scan("velodyne_vlp16").category_id) == {8}
    with pytest.raises(ec.ArgumentError, match="2 x 4 x 4"):
        live.set_motion(number, [0.0, 1.0], poses[:1])
    with pytest.raises(ec.Error, match="never fall"):
        live.set_motion(number, [1.0, 0.0], poses)


def test_vertices_move_during_a_scan() -> None:
    live = ec.LiveScene()
    number = live.add(SQUARE, TWO, category=7)
    moved = np.stack([SQUARE + np.array([x, 0, 0], np.float32) for x in (5, 9)])
    live.set_vertex_motion(number, [0.0, 2.0], moved)
    live.set_time(1.0)
    assert abs(np.median(places(live.scan("velodyne_vlp16"), 7)) - 7) < 0.05
    with pytest.raises(ec.ArgumentError, match="1 x m x 3"):
        live.set_vertex_motion(number, [0.0], moved)
    with pytest.raises(ec.Error, match="as many as before"):
        live.set_vertex_motion(number, [0.0, 2.0], moved[:, :3])


def test_what_things_are_made_of_is_told() -> None:
    """Head-on, intensity is in proportion to reflectance."""
    bright, dark = {"name": "paint", "reflectance": 0.8}, "{name: soot, reflectance: 0.2}"

    def one(material: Any) -> ec.Scene:
        return ec.Scene.from_objects([dict(vertices=SQUARE, triangles=TWO, pose=(6, 0, 0), material=material)])

    def mean(scene: ec.Scene | ec.LiveScene) -> float:
        return float(scene.scan("velodyne_vlp16", fields="intensity,material_id", at=(0, 0, 0)).intensity.mean())

    assert mean(one(material=bright)) == pytest.approx(4 * mean(one(material=dark)), rel=0.1)
    assert mean(one(material="asphalt_dry")) < mean(one(material=bright))
    moved = SQUARE + np.array([6, 0, 0], np.float32)
    live = ec.LiveScene()
    live.add(moved, TWO, material=bright, fixed=True)
    assert mean(live) == mean(ec.Scene.from_arrays(moved, TWO, material=bright)) > 0
    # Who has a name has a number, however the scene is made.
    live = ec.LiveScene()
    live.add(moved, TWO, material="asphalt_dry")
    made = one("asphalt_dry")
    for scene in (made, ec.LiveScene(made), ec.Scene.from_arrays(moved, TWO, material="asphalt_dry"), live):
        cloud = scene.scan("velodyne_vlp16", fields="default,material_id")
        assert cloud.materials == {1: "asphalt_dry"} and set(cloud.material_id) == {1}
    with pytest.raises(ec.Error, match="library material"):
        one(material="asphlat")
    with pytest.raises(ec.Error, match="reflectance"):
        one(material={"name": "mirror", "reflectance": 2})
