"""What goes wrong is told in sentences of this package, in words of its users."""

import copy
import pickle
import re
import warnings
from collections import UserDict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import echocast as ec

FLOOR = np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], dtype=np.float32)
TWO = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)

# What Rust, PyO3, CPython and NumPy say.
RAW = re.compile(
    r"failed to extract|PyArray|Can't extract|DVec3|DQuat|Some\(|None\b.*Rust|Pose \{|\bstruct\b|\n|object is not|'[^']*' object"
    r"|must be (real|str|int)|interpreted as|can't convert|out of range|sequence of length|iterable|unhashable|ufunc"
    r"|too (large|big)|\bitem\b.*not|has no attribute|codec|cannot fit|^expected"
)

LIVE = ec.LiveScene()
DOOR = LIVE.add(FLOOR, TWO)
SCENE = ec.Scene.from_arrays(FLOOR, TWO, name="floor")
CLOUD = SCENE.scan("velodyne_vlp16", at=(0, 0, 1.8))
MIRROR = np.diag([1.0, -1, 1, 1])


def scan(**options: Any) -> Any:
    return SCENE.scan("velodyne_vlp16", **{"at": (0, 0, 1.8), **options})


# Calls that cannot be meant, typed as what they are not, with what is said of them.
MISTAKES: "list[tuple[Callable[..., Any], tuple[Any, ...], type[Exception], str]]" = [
    (lambda at: scan(at=at), ((0, 1),), ec.ArgumentError, "at is 2 numbers; allowed: a Pose, a Trajectory, x, y and z, or"),
    (lambda at: scan(at=at), (np.zeros((3, 3)),), ec.ArgumentError, "at is 3 x 3; allowed: a Pose"),
    (lambda at: scan(at=at), ("here",), TypeError, "at is of the type str; allowed: a Pose"),
    (lambda at: scan(at=at), ([[1, 2], [3]],), ec.ArgumentError, "at has rows of different lengths; allowed: a Pose"),
    (lambda at: scan(at=at), (2 * np.eye(4),), ec.ArgumentError, "at is a matrix whose last row is .*; allowed: 0, 0, 0, 1"),
    (lambda at: scan(at=at), (MIRROR,), ec.ArgumentError, "at is a matrix that scales, shears or mirrors; allowed: one that"),
    (lambda at: scan(at=at), ((np.nan, 0, 1),), ec.ArgumentError, r"pose is at \[NaN, 0.0, 1.0\] .*; allowed: finite"),
    (lambda seed: scan(seed=seed), (1.5,), TypeError, "seed is of the type float; allowed: a whole number from 0 to 18446744073709551615"),
    (lambda time: scan(start_time=time), ("now",), TypeError, "start_time is of the type str; allowed: a number"),
    (lambda fields: scan(fields=fields), (3,), TypeError, "fields is of the type int; allowed: names of col"),
    (lambda fog: scan(environment=fog), (3,), TypeError, "environment is of the type int; allowed: an Env"),
    (ec.Sensor, (3,), TypeError, "sensor is of the type int; allowed: a name, the path of a file, keys"),
    (SCENE.scan, (3,), TypeError, "sensor is of the type int; allowed: a Sensor, the name of a preset"),
    (ec.Scenario, (3,), TypeError, "scenario is of the type int; allowed: a Scenario, the path of a file"),
    (ec.Scene.load, (3,), TypeError, "files is of the type int; allowed: the path of a file, or a list"),
    (ec.Scene.from_arrays, ("floor", TWO), TypeError, "vertices is of the type str; allowed: n x 3 numbers"),
    (ec.Scene.from_arrays, (FLOOR > 0, TWO), TypeError, "vertices is an array of bool, 4 x 3; allowed: n x 3 numbers"),
    (ec.Scene.from_arrays, (FLOOR.ravel(), TWO), ec.ArgumentError, "vertices is 12 long; allowed: n x 3"),
    (ec.Scene.from_arrays, (FLOOR, TWO.astype(float)), TypeError, "triangles is an array of float64, 2 x 3; allowed: n x"),
    (ec.Scene.from_arrays, (FLOOR, [[0, 1, -1]]), ec.ArgumentError, "triangles has the number -1; allowed: 0 to 4294967295"),
    (ec.Scene.from_objects, ([FLOOR],), TypeError, "object 0 is of the type ndarray; allowed: a dict with keys of vertices"),
    (ec.Scene.from_objects, ("abc",), TypeError, "objects is of the type str; allowed: a list of dicts, one for each object"),
    (ec.Scene.from_objects, ({"vertices": FLOOR, "triangles": TWO},), TypeError, "objects is of the type dict; allowed: a list of"),
    (ec.Scene.from_objects, ([], "road"), TypeError, "takes 1 positional arguments? but 2 were given"),
    (lambda names: ec.Scene.from_arrays(FLOOR, TWO, names=names), (["road"],), TypeError, "names is of the type list; allowed: a dict"),
    (
        lambda names: ec.Scene.from_arrays(FLOOR, TWO, names=names),
        ({-1: "a"},),
        ec.ArgumentError,
        "a number in names is -1; allowed: 0 to 4294967295",
    ),
    (lambda number: LIVE.add(FLOOR, TWO, category=number), (-1,), ec.ArgumentError, "category is -1; allowed: 0"),
    (lambda width: CLOUD.png(width=width), (-1,), ec.ArgumentError, "width is -1; allowed: 0 to 4294967295"),
    (ec.Pose, ((0, 1),), ec.ArgumentError, "position is 2 numbers; allowed: a Pose, x, y and z, or a matrix of 4 x 4"),
    (ec.Pose, (MIRROR,), ec.ArgumentError, "position is a matrix that scales, shears or mirrors; allowed: one that turns"),
    (lambda rpy: ec.Pose(np.eye(4), rpy_deg=rpy), ((0, 0, 9),), ec.ArgumentError, "rpy_deg is there beside a pose or matrix; allowed: one"),
    (lambda rpy: ec.Pose(rpy_deg=rpy), ((0, 0),), ec.ArgumentError, "rpy_deg is 2 numbers; allowed: 3"),
    (CLOUD.to_ros, (3,), TypeError, "driver is of the type int; allowed: a text"),
    (lambda boxes: scan(boxes=boxes), (3,), TypeError, "boxes is of the type int; allowed: True, False, object or frame"),
    (lambda progress: scan(progress=progress), (3,), TypeError, "progress is of the type int; allowed: a function, True or False"),
    (SCENE.camera, (3,), TypeError, "name is of the type int; allowed: a text"),
    (CLOUD.__getitem__, (2**63,), IndexError, "point 9223372036854775808; there are"),
    (CLOUD.__getitem__, (-(2**63) - 1,), IndexError, "point -9223372036854775809; there are"),
    (ec.Scene.from_objects, ([{"vertices": FLOOR}],), KeyError, 'object 0 has no "triangles"; needed: vertices, triangles'),
    (
        ec.Scene.from_objects,
        ([{"vertices": FLOOR, "triangles": TWO, "category": -1}],),
        ec.ArgumentError,
        "category of object 0 is -1; allowed: 0 to 4294967295",
    ),
    (LIVE.set_pose, (DOOR, "there"), TypeError, "pose is of the type str; allowed: a Pose, x, y and z, or a matrix of 4 x 4"),
    (LIVE.set_pose, (DOOR, np.eye(4) + np.eye(4, k=-3)), ec.ArgumentError, "pose is a matrix whose last row is"),
    (LIVE.set_motion, (DOOR, "ab", np.eye(4)[None]), TypeError, "times is of the type str; allowed: n numbers"),
    (LIVE.set_motion, (DOOR, [0.0], np.eye(4)), ec.ArgumentError, "poses is 4 x 4; allowed: n x 4 x 4"),
    (ec.Trajectory, ([0, 1], [[0, 0], [1, 1]]), ec.ArgumentError, "positions is 2 x 2; allowed: 2 x 3, a row for each time"),
    (ec.Pose, ((np.inf, 0, 0),), ec.ArgumentError, r"position is \[inf, 0.0, 0.0\]; allowed: finite numbers"),
    (CLOUD.__getitem__, (len(CLOUD),), IndexError, "point .*; there are"),
    (CLOUD.__getitem__, (True,), TypeError, "the key of a cloud is of the type bool; allowed: the name of a column, the"),
    (CLOUD.__getitem__, (None,), TypeError, "the key of a cloud is of the type NoneType; allowed: the name of a column"),
    (CLOUD.__getitem__, ([0.5],), TypeError, "the key of a cloud is an array of float64, 1 long; allowed: the name of"),
    (CLOUD.__getitem__, (["x", "y"],), TypeError, "the key of a cloud is a list of other things than numbers; allowed: the name of a column"),
    (CLOUD.__getitem__, ([True, False],), ec.ArgumentError, "mask is 2 long; allowed"),
    (CLOUD.__getitem__, ([2**63],), ec.ArgumentError, "row is 9223372036854775807; allowed: -"),
    (CLOUD.__getitem__, ("rnage",), KeyError, 'there is no column named "rnage"; near: range'),
    (CLOUD.to_torch, (3,), TypeError, "columns is of the type int; allowed: names of columns in a list"),
    (pickle.dumps, (SCENE,), TypeError, "a Scene cannot be pickled or copied: let each process load its file"),
    (copy.deepcopy, (LIVE,), TypeError, "a LiveScene cannot be pickled or copied: let each process make one"),
]


@pytest.mark.parametrize("number", range(len(MISTAKES)))
def test_mistakes_are_told(number: int) -> None:
    call, arguments, kind, told = MISTAKES[number]
    with pytest.raises(kind, match=told) as caught:
        call(*arguments)
    assert not RAW.search(str(caught.value)), caught.value


def test_attributes_that_are_no_columns_are_told() -> None:
    """And type checkers tell it before: these would be errors of theirs."""
    with pytest.raises(AttributeError, match='a PointCloud has no "rnage"; near: range'):
        CLOUD.rnage  # type: ignore[attr-defined]
    with pytest.raises(AttributeError, match='a PointCloud has no "wirte"; near: write'):
        CLOUD.wirte("a.las")  # type: ignore[attr-defined]
    assert not hasattr(CLOUD, "_repr_svg_")


@pytest.mark.parametrize("wide", [np.float64, np.float32, list])
def test_numbers_of_any_type_make_the_same_scene(wide: Any) -> None:
    vertices = FLOOR.tolist() if wide is list else FLOOR.astype(wide)
    for triangles in (TWO, TWO.astype(np.int64), TWO.astype(">i2"), TWO.tolist()):
        scene = ec.Scene.from_arrays(vertices, triangles, categories=[7, 7])
        assert np.array_equal(scene.scan("velodyne_vlp16", at=[0, 0, 1.8]).range, CLOUD.range)
    live = ec.LiveScene()
    door = live.add(vertices, TWO.tolist())
    live.set_vertices(door, vertices)
    live.set_vertex_motion(door, [0, 1], [vertices, vertices])
    live.set_motion(door, np.array([0, 1], np.float32), [np.eye(4), np.eye(4)])
    assert np.allclose(live.scan("velodyne_vlp16", at=(0, 0, 1.8)).range, CLOUD.range, atol=0.01)


def test_far_away_vertices_keep_their_place() -> None:
    """At UTM coordinates float32 is half a metre coarse."""
    far = np.array([500_000.25, 5_600_000.25, 0])
    vertices, sensor = FLOOR + far, far + [0.0, 0, 1.8]
    scenes = [ec.Scene.from_arrays(vertices, TWO), ec.Scene.from_arrays(vertices, TWO, categories=[1, 2])]
    scenes.append(ec.Scene.from_objects([{"vertices": vertices, "triangles": TWO}]))
    for scene in scenes:
        bounds = scene.bounds
        assert bounds is not None and np.array_equal(bounds, [far - [9, 9, 0], far + [9, 9, 0]])
        assert abs(np.median(scene.scan("velodyne_vlp16", at=sensor).range) - np.median(CLOUD.range)) < 0.01


WALL = np.array([[5, -5, -5], [5, 5, -5], [5, 5, 5], [5, -5, 5]], dtype=np.float64)
UTM = np.array([5_600_000.2, 500_000.3, 100.1])


def ahead(live: ec.LiveScene, x: float) -> float:
    """What a beam straight ahead measures from `x` metres before UTM, at rest."""
    beam = {"name": "one", "kind": "lidar", "pattern": {"type": "pinhole", "resolution": [1, 1], "fov_deg": [1, 1]}}
    return float(live.scan(beam, at=UTM + [x, 0, 0]).range[0])


def test_far_away_vertices_keep_their_place_while_things_change() -> None:
    """However an object gets its place, its vertices are where they were given, to a millimetre."""

    def given() -> "tuple[ec.LiveScene, int]":
        live = ec.LiveScene()
        return live, live.add(WALL + UTM, TWO)

    def from_scene() -> "tuple[ec.LiveScene, int]":
        live = ec.LiveScene(ec.Scene.from_arrays(WALL + UTM, TWO, name="wall"))
        return live, live.find("wall")

    def near() -> "tuple[ec.LiveScene, int]":
        live = ec.LiveScene()
        return live, live.add(WALL, TWO, pose=UTM)

    def moved(live: ec.LiveScene, wall: int) -> None:
        poses = np.stack([np.eye(4), np.eye(4)])
        poses[1, 0, 3] = 8
        live.set_motion(wall, [0, 1], poses)

    def nothing(live: ec.LiveScene, wall: int) -> None:
        pass

    def copied(live: ec.LiveScene, wall: int) -> None:
        live.add_copy(wall)
        live.remove(wall)

    def bent(live: ec.LiveScene, wall: int) -> None:
        live.set_vertex_motion(wall, [0, 1], np.stack([WALL + UTM, WALL + UTM + [8, 0, 0]]))

    changes: "list[Callable[[ec.LiveScene, int], object]]" = [
        nothing,
        copied,
        moved,
        bent,
        lambda live, wall: live.set_pose(wall, (0, 0, 0)),
        lambda live, wall: live.set_vertices(wall, WALL + UTM),
    ]
    for make in (given, from_scene):
        for change in changes:
            live, wall = make()
            change(live, wall)
            for x in (0, 0.1, 0.2):
                assert abs(ahead(live, x) - (5 - x)) < 1e-3
    # The poses of a motion are those of the vertices as given, too, wherever they come from.
    for change in (moved, bent):
        live, wall = given()
        change(live, wall)
        live.set_time(0.5)
        assert abs(ahead(live, 0) - 9) < 1e-3
    live, wall = near()
    moved(live, wall)
    live.set_vertices(wall, WALL + UTM)
    assert abs(ahead(live, 0.1) - 4.9) < 1e-3
    live.set_time(0.5)
    assert abs(ahead(live, 0.1) - 8.9) < 1e-3
    live, wall = near()
    live.set_pose(wall, (0, 0, 0))
    live.set_vertices(wall, WALL + UTM)
    assert abs(ahead(live, 0.1) - 4.9) < 1e-3
    live.set_pose(wall, (1, 0, 0))
    assert abs(ahead(live, 0.1) - 5.9) < 1e-3
    live.set_vertices(wall, (WALL + [2, 0, 0]).astype(np.float32))
    live.set_pose(wall, UTM)
    assert abs(ahead(live, 0.1) - 6.9) < 1e-3


def test_errors_of_mappings_get_through() -> None:
    """That a key is not there is a KeyError; others are those of who made the mapping."""

    class Broken(UserDict[str, Any]):
        def __getitem__(self, key: str) -> Any:
            if key in self.data:
                return self.data[key]
            raise KeyError(key) if key != self.broken else RuntimeError("the disk is gone")

        broken = ""

    class BrokenName(Broken):
        broken = "name"

    class BrokenArray(Broken):
        broken = "triangles"

    assert ec.Scene.from_objects([Broken(vertices=FLOOR, triangles=TWO)]).triangles == 2  # type: ignore[list-item]
    for thing in (BrokenName(vertices=FLOOR, triangles=TWO), BrokenArray(vertices=FLOOR)):
        with pytest.raises(RuntimeError, match="the disk is gone"):
            ec.Scene.from_objects([thing])  # type: ignore[list-item]


def test_a_matrix_places_the_sensor() -> None:
    pose = ec.Pose((1, 2, 1.8), rpy_deg=(0, 10, 90))
    for matrix in (np.array(pose.matrix), pose.matrix, np.array(pose.matrix, np.float32)):
        placed = scan(at=matrix)
        assert np.allclose(placed.sensor_pose.matrix, pose.matrix, atol=1e-6)
        assert np.allclose(ec.Pose(matrix).matrix, pose.matrix, atol=1e-6)
    assert np.array_equal(scan(at=np.array([0, 0, 1.8])).range, CLOUD.range)


def test_keys_may_be_numbers_of_numpy() -> None:
    sensor = ec.Sensor("velodyne_vlp16")
    sensor["noise.range_sigma_m"] = np.float32(0.25)
    assert sensor["noise.range_sigma_m"] == 0.25
    sensor["pattern.channels.elevation_deg"] = np.linspace(-8, 8, 16)
    assert sensor.beams == ec.Sensor("velodyne_vlp16").beams
    with pytest.raises(TypeError, match="a value is of the type object; allowed: numbers, texts, lists and dicts"):
        sensor["noise.range_sigma_m"] = object()


@pytest.mark.parametrize(
    "thing",
    [
        ec.Environment(),
        ec.Environment({}),
        ec.Environment({"fog": {"visibility_m": 20}}),
        ec.Trajectory([0, 1], [[0, 0, 2], [10, 0, 2]], [[0, 0, 0, 1], [0, 0, 2, 1]]),
    ],
)
def test_what_says_where_and_when_pickles(thing: Any) -> None:
    for again in (pickle.loads(pickle.dumps(thing)), copy.copy(thing), copy.deepcopy(thing)):
        assert repr(again) == repr(thing)
        if isinstance(thing, ec.Trajectory):
            assert np.allclose(again.at(0.3).matrix, thing.at(0.3).matrix, atol=1e-15)


def test_a_scan_without_a_place_says_so() -> None:
    with pytest.warns(UserWarning, match="the sensor is at 0, 0, 0, as at is not given; allowed: a Pose") as told:
        SCENE.pings("sbes_200", 1)
    assert Path(told[0].filename) == Path(__file__)
    flat = ec.Scene.generate("indoor", rooms=[1, 1])
    for scene in (flat, ec.LiveScene(flat)):
        with pytest.warns(UserWarning, match=r'the scene has a camera: at=scene.camera\("'):
            scene.scan("velodyne_vlp16")


def test_a_scan_without_points_says_why() -> None:
    """In the words of the program."""
    empty = "no beam has a return: the scene has no triangles"
    away = "no beam has a return: the sensor starts at 5000.0,0.0,1.0 and sees .* m, the scene reaches from -9.0,-9.0,0.0 to"
    above = "no beam has a return, though the scene is within range of the sensor; perhaps its beams miss the scene"
    sees: list[tuple[ec.Scene | ec.LiveScene, Any, str]] = [
        (ec.LiveScene(), (0, 0, 0), empty),
        (SCENE, (5000, 0, 1), away),
        (ec.LiveScene(SCENE), (5000, 0, 1), away),
        (SCENE, (0, 0, 50), above),
    ]
    for scene, at, why in sees:
        for organised in (False, True):
            with pytest.warns(UserWarning, match=why):
                scene.scan("velodyne_vlp16", at=at, organised=organised)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(scan()) > 0 and len(scan(organised=True)) > 0


def test_a_point_is_a_record() -> None:
    """As the rows of the array that NumPy makes of the cloud are."""
    rows = np.asarray(CLOUD)
    for index in (0, 3, -1, np.int64(5)):
        point = CLOUD[index]
        assert point == rows[index] and point.range == CLOUD.range[index] and point["x"] == CLOUD.x[index]
    assert len([point.range for point in CLOUD[:5]]) == 5
    with pytest.raises(IndexError):
        CLOUD[-len(CLOUD) - 1]


def test_notebooks_show_a_picture_and_a_table() -> None:
    told = CLOUD._repr_html_()
    assert told.startswith('<div><img src="data:image/png;base64,iVBOR') and f"<b>{len(CLOUD):,} points</b>" in told
    assert told.count("<tr>") == len(CLOUD.fields) + 1
    named = ec.Scene.from_arrays(FLOOR, TWO, categories=[1, 2], names={1: "<road>", 2: "path"})
    assert "&lt;road&gt;, path" in named.scan("velodyne_vlp16", at=(0, 0, 1.8))._repr_html_()
    assert "<b>0 points</b>" in CLOUD[:0]._repr_html_()
