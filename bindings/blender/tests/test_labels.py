"""Labels: categories, parts and instances by custom properties and by names."""

import json
import math
from pathlib import Path
from typing import Any

import bpy
import echocast as ec
import makers
import numpy as np
import pytest
from echocast_blender import clouds

COLUMNS = "x,y,z,category_id,part_id,instance_id"


@pytest.fixture(autouse=True)
def camera(tmp_path: Path) -> Any:
    """A line of pixels that sees what is at x = 4, from y = 3 to -3."""
    pattern = {"type": "pinhole", "resolution": [280, 6], "fov_deg": [80, 6], "rate_hz": 30}
    return makers.sensor(makers.write_sensor(tmp_path / "line.yaml", pattern=pattern))


def box(name: str, y: float = 0.0, *materials: Any) -> Any:
    return makers.cube(name, 0.5, (4, y, 0), *materials)


def at(seen: ec.PointCloud, y: float, column: str = "category") -> "set[tuple[int, str]]":
    """Numbers and names of what is at y."""
    place = seen.xyz + np.array(seen.origin)
    mask = np.abs(place[:, 1] - y) < 0.27
    assert mask.any()
    table = {"category": seen.categories, "part": seen.parts, "instance": seen.instances}[column]
    return {(int(number), table.get(int(number), "")) for number in np.unique(seen[f"{column}_id"][mask])}


def names(seen: ec.PointCloud, y: float, column: str = "category") -> "set[str]":
    return {name for _, name in at(seen, y, column)}


def numbers(seen: ec.PointCloud, y: float, column: str = "instance") -> "set[int]":
    return {number for number, _ in at(seen, y, column)}


# --- categories -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "number", "name"),
    [
        (7, 7, "7"),
        (7.0, 7, "7"),
        ("7", 7, "7"),
        ("chair", 1, "chair"),
        (2.5, 1, "2.5"),
        (-1, 1, "-1"),
        (0, 0, ""),
        ("", 0, ""),
        ([1, 2], 1, "[1, 2]"),
    ],
    ids=repr,
)
def test_values_of_category(value: Any, number: int, name: str) -> None:
    box("Thing")["categoryID"] = value
    assert at(makers.cloud(COLUMNS), 0) == {(number, name)}


def chain_of_an_object() -> "list[Any]":
    """What may give a category, the nearest first: an object, two parents, its material."""
    material = makers.material()
    grandparent = makers.empty("Grandparent", (1, 0, 0))
    parent = makers.empty("Parent", (1, 0, 0), grandparent)
    thing = box("Thing", 0, material)
    thing.parent, thing.location = parent, (2, 0, 0)
    return [thing, parent, grandparent, material]


def chain_of_an_instance() -> "list[Any]":
    """Likewise in a collection that an empty instances, which has a parent."""
    *things, material = chain_of_an_object()
    above = makers.empty("Above", (1, 0, 0))
    instancer = makers.empty("Instancer", (-1, 0, 0), above)
    instancer.instance_type = "COLLECTION"
    instancer.instance_collection = makers.collection("Collection", *things)
    return [*things, instancer, above, material]


@pytest.mark.parametrize("chain", [chain_of_an_object, chain_of_an_instance])
def test_the_nearest_category_counts(chain: Any) -> None:
    givers = chain()
    for giver in givers:
        giver["categoryID"] = f"of {giver.name}"
    for giver in givers:
        assert names(makers.cloud(COLUMNS), 0) == {f"of {giver.name}"}
        del giver["categoryID"]
        giver.update_tag() if isinstance(giver, bpy.types.Object) else giver.node_tree.update_tag()


def test_names_without_copy_numbers() -> None:
    for index, name in enumerate(("Chair", "Chair.001", "Chair.1234", "Chair.12", "Table.v2")):
        box(name, 2.0 - index)
    seen = makers.cloud(COLUMNS)
    assert [names(seen, 2.0 - index) for index in range(5)] == [{"Chair"}] * 3 + [{"Chair.12"}, {"Table.v2"}]
    assert len({number for index in range(3) for number in numbers(seen, 2.0 - index)}) == 3
    assert names(seen, 1, "instance") == {"Chair.001"}


def test_pieces_have_the_name_of_their_outermost_parent() -> None:
    car = makers.empty("Car.002", (1, 0, 0))
    for name, y in (("Wheel", -1), ("Body", 1)):
        piece = box(name, y)
        piece.parent, piece.location.x = car, 3
    seen = makers.cloud(COLUMNS)
    assert at(seen, -1) == at(seen, 1) == {(1, "Car")}
    assert at(seen, -1, "instance") == at(seen, 1, "instance")


def grouped(**changes: Any) -> Any:
    """A box in an object called Room."""
    room = makers.empty("Room")
    thing = box("Thing")
    thing.parent = room
    for name, value in changes.items():
        setattr(room, name, value)
    return room


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({}, "Thing"),
        ({"rotation_euler": (0.02, 0, 0), "scale": (1.01, 1, 1)}, "Thing"),
        ({"location": (0.1, 0, 0)}, "Room"),
    ],
    ids=json.dumps,
)
def test_groups_are_at_the_origin_of_their_parents(changes: "dict[str, Any]", name: str) -> None:
    room = grouped(**changes)
    assert names(makers.cloud(COLUMNS), 0) == {name}
    # So is what holds only such a group.
    house = makers.empty("House", (0.1, 0, 0))
    room.parent = house
    assert names(makers.cloud(COLUMNS), 0) == ({"Thing"} if name == "Thing" else {"House"})
    # An empty is no piece of it, another thing is.
    makers.empty("Mark", (5, 0, 0), house)
    assert names(makers.cloud(COLUMNS), 0) == ({"Thing"} if name == "Thing" else {"House"})
    box("Other", 2).parent = house
    assert names(makers.cloud(COLUMNS), 0) == {"House"}


@pytest.mark.parametrize(("path", "name"), [("location", "Room"), ("rotation_euler", "Thing")])
def test_a_group_that_moves_is_none(path: str, name: str) -> None:
    room = grouped()
    room.keyframe_insert(path, frame=1)
    assert names(makers.cloud(COLUMNS), 0) == {name}


def test_many_pieces_are_a_group_and_armatures_may_be() -> None:
    heap = makers.empty("Heap", (0.1, 0, 0))
    box("Thing").parent = heap
    for index in range(63):
        makers.cube(f"Stone{index}", 0.1, (0, 0, -50 - index)).parent = heap
    assert names(makers.cloud(COLUMNS), 0) == {"Heap"}
    makers.cube("Last", 0.1, (0, 0, -40)).parent = heap
    assert names(makers.cloud(COLUMNS), 0) == {"Thing"}
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(rig)
    bpy.data.objects["Thing"].parent = rig
    assert names(makers.cloud(COLUMNS), 0) == {"Thing"}


def test_numbers_are_free_of_those_that_are_given() -> None:
    box("First", 1)["categoryID"] = "2"
    box("Second", 0)["categoryID"] = "apple"
    box("Third", -1)["categoryID"] = "banana"
    box("Fourth", 2)["categoryID"] = "cherry"
    seen = makers.cloud(COLUMNS)
    assert seen.categories == {2: "2", 1: "apple", 3: "banana", 4: "cherry"}


# --- parts ------------------------------------------------------------------------------------------------------------


def test_parts_are_those_of_materials_or_their_names() -> None:
    wood, steel = makers.material("Wood"), makers.material("Steel.001")
    steel["partID"] = "frame"
    thing = makers.thing(
        "Thing",
        [(0, y, z) for z in (-0.5, 0.5) for y in (1.5, 0, -1.5)],
        [(0, 1, 4, 3), (1, 2, 5, 4)],
        wood,
        steel,
    )
    thing.location.x = 4
    thing.data.polygons[1].material_index = 1
    seen = makers.cloud(COLUMNS)
    assert (names(seen, 1, "part"), names(seen, -1, "part")) == ({"Wood"}, {"frame"})
    thing["partID"] = 5
    thing.update_tag()
    seen = makers.cloud(COLUMNS)
    assert at(seen, 1, "part") == at(seen, -1, "part") == {(5, "5")}


def test_part_of_a_parent_and_without_material() -> None:
    box("Bare", 1)
    parent = makers.empty("Parent", (1, 0, 0))
    parent["partID"] = "wing"
    piece = box("Piece", -1)
    piece.parent, piece.location.x = parent, 3
    seen = makers.cloud(COLUMNS)
    assert at(seen, 1, "part") == {(0, "")}
    assert names(seen, -1, "part") == {"wing"}


def test_a_changed_part_of_a_material_is_seen() -> None:
    paint = makers.material("Paint")
    box("Thing", 0, paint)
    assert names(makers.cloud(COLUMNS), 0, "part") == {"Paint"}
    paint["partID"] = "lacquer"
    paint.node_tree.update_tag()
    assert names(makers.cloud(COLUMNS), 0, "part") == {"lacquer"}


# --- numbers ----------------------------------------------------------------------------------------------------------


def test_numbers_stay_while_the_scene_changes() -> None:
    box("Pear", 1)
    box("Plum", 0)
    before = makers.cloud(COLUMNS)
    box("Apple", -1)
    after = makers.cloud(COLUMNS)
    for y in (1, 0):
        for column in ("category", "instance"):
            assert at(before, y, column) == at(after, y, column)
    assert numbers(after, -1, "category") == {3}
    bpy.data.objects.remove(bpy.data.objects["Plum"])
    bpy.data.objects["Pear"].location.y = 2
    later = makers.cloud(COLUMNS)
    assert at(later, 2) == at(before, 1) and at(later, 2, "instance") == at(before, 1, "instance")
    assert at(later, -1) == at(after, -1)
    box("Plum", 0)
    assert at(makers.cloud(COLUMNS), 0) == at(before, 0)


def test_a_changed_category_is_seen() -> None:
    thing = box("Thing")
    thing["categoryID"] = "tree"
    assert names(makers.cloud(COLUMNS), 0) == {"tree"}
    thing["categoryID"] = "bush"
    assert names(makers.cloud(COLUMNS), 0) == {"bush"}
    thing.name = "Shrub"
    del thing["categoryID"]
    assert names(makers.cloud(COLUMNS), 0) == {"Shrub"}
    assert names(makers.cloud(COLUMNS), 0, "instance") == {"Shrub"}


# --- instances --------------------------------------------------------------------------------------------------------


def test_pieces_below_a_category_are_one_instance() -> None:
    table = makers.empty("Table", (0, 0, 0))
    table["categoryID"] = "table"
    for name, y in (("Leg", -1), ("Top", 1)):
        box(name, y).parent = table
    box("Other", 0)
    seen = makers.cloud(COLUMNS)
    assert at(seen, -1, "instance") == at(seen, 1, "instance")
    assert names(seen, 1, "instance") == {"Table"}
    assert numbers(seen, 0) != numbers(seen, 1)


def instanced(name: str, y: float, what: Any) -> Any:
    made = makers.empty(name, (4, y, 0))
    made.instance_type, made.instance_collection = "COLLECTION", what
    return made


def test_each_collection_instance_is_one() -> None:
    """Both pieces of it, which are side by side."""
    pieces = [makers.cube("Left", 0.3, (0, 0.25, 0)), makers.cube("Right", 0.3, (0, -0.25, 0))]
    chair = makers.collection("Chair", *pieces)
    for index, y in enumerate((2, 0, -2)):
        instanced(f"Copy{index}", y, chair)
    seen = makers.cloud(COLUMNS)
    for y in (2, 0, -2):
        assert numbers(seen, y + 0.25) == numbers(seen, y - 0.25)
        assert names(seen, y + 0.25) == {"Left"} and names(seen, y - 0.25) == {"Right"}
        assert names(seen, y + 0.25, "instance") == {f"Copy{(2 - y) // 2}"}
    assert len({number for y in (2, 0, -2) for number in numbers(seen, y + 0.25)}) == 3


def test_pieces_of_a_collection_with_categories_of_their_own_are_instances() -> None:
    pieces = [makers.cube("Cup", 0.3, (0, 0.5, 0)), makers.cube("Plate", 0.3, (0, -0.5, 0))]
    for piece in pieces:
        piece["categoryID"] = piece.name
    cover = makers.collection("Cover", *pieces)
    instanced("One", 1.5, cover)
    instanced("Two", -1.5, cover)
    seen = makers.cloud(COLUMNS)
    found = [numbers(seen, y) for y in (2, 1, -1, -2)]
    assert all(len(one) == 1 for one in found) and len({next(iter(one)) for one in found}) == 4
    assert names(seen, 2, "instance") == {"Cup"}


def test_a_text_and_a_mesh_in_a_collection_instance_are_one() -> None:
    curve = bpy.data.curves.new("Sign", "FONT")
    curve.body, curve.align_x, curve.align_y = "M", "CENTER", "CENTER"
    sign = bpy.data.objects.new("Sign", curve)
    bpy.context.scene.collection.objects.link(sign)
    sign.location, sign.rotation_euler = (0, 0.5, 0), (math.pi / 2, 0, -math.pi / 2)
    instanced("One", 0, makers.collection("Shop", makers.cube("Post", 0.3, (0, -0.5, 0)), sign))
    seen = makers.cloud(COLUMNS)
    assert numbers(seen, 0.5) == numbers(seen, -0.5)


def test_each_collection_instance_in_an_instanced_collection_is_one() -> None:
    pieces = [makers.cube("Left", 0.3, (0, 0.25, 0)), makers.cube("Right", 0.3, (0, -0.25, 0))]
    chair = makers.collection("Chair", *pieces)
    pair = [instanced("One", 0.75, chair), instanced("Two", -0.75, chair)]
    for one in pair:
        one.location.x = 0
    room = makers.collection("Room", *pair)
    instanced("Room1", 1.5, room)
    instanced("Room2", -1.5, room)
    seen = makers.cloud(COLUMNS)
    chairs = [numbers(seen, room + chair + 0.25) for room in (1.5, -1.5) for chair in (0.75, -0.75)]
    assert all(len(one) == 1 for one in chairs) and len({next(iter(one)) for one in chairs}) == 4
    assert chairs == [numbers(seen, room + chair - 0.25) for room in (1.5, -1.5) for chair in (0.75, -0.75)]


def test_instances_of_a_category_of_the_instancer() -> None:
    chair = makers.collection("Chair", makers.cube("Piece", 0.4))
    for name, y in (("One", 1), ("Two", -1)):
        instanced(name, y, chair)["categoryID"] = "seat"
    seen = makers.cloud(COLUMNS)
    assert names(seen, 1) == names(seen, -1) == {"seat"}
    assert numbers(seen, 1) != numbers(seen, -1)


def particles(emitter: Any, count: int, **settings: Any) -> Any:
    system = emitter.modifiers.new("Particles", "PARTICLE_SYSTEM").particle_system
    made = system.settings
    made.type, made.count, made.hair_length, made.particle_size = "HAIR", count, 1.0, 1.0
    made.use_advanced_hair = True
    made.use_rotations = False
    for name, value in settings.items():
        setattr(made, name, value)
    emitter.show_instancer_for_render = False
    return made


@pytest.mark.parametrize("what", ["OBJECT", "COLLECTION"])
def test_each_particle_is_one(what: str) -> None:
    """On the four corners of a mesh, of a cube or of a collection of two."""
    corners = [(0.1 * (index % 2), y, 0) for index, y in enumerate((2.1, 0.7, -0.7, -2.1))]
    emitter = makers.thing("Emitter", corners, [(0, 1, 2, 3)])
    emitter.location.x = 4
    options: "dict[str, Any]" = {"emit_from": "VERT", "use_emit_random": False, "render_type": what}
    if what == "OBJECT":
        options["instance_object"] = makers.cube("Single", 0.5, (0, 0, -50))
    else:
        pieces = [makers.cube("Left", 0.3, (0, 0.25, 0)), makers.cube("Right", 0.3, (0, -0.25, 0))]
        options.update(instance_collection=makers.collection("Chair", *pieces), use_whole_collection=True)
    particles(emitter, 4, **options)
    seen = makers.cloud(COLUMNS)
    place = seen.xyz + np.array(seen.origin)
    found = np.unique(seen["instance_id"])
    assert len(found) == 4
    middles = sorted(float(place[seen["instance_id"] == number, 1].mean()) for number in found)
    assert np.diff(middles).min() > 1


def test_each_instance_of_geometry_nodes_is_one() -> None:
    tree, start, end = clouds.geometry_tree("Scatter")
    scatter, what = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new("GeometryNodeObjectInfo")
    what.inputs["Object"].default_value = makers.cube("Stone", 0.4, (0, 0, -50))
    what.inputs["As Instance"].default_value = True
    tree.links.new(start.outputs[0], scatter.inputs["Points"])
    tree.links.new(what.outputs["Geometry"], scatter.inputs["Instance"])
    tree.links.new(scatter.outputs[0], end.inputs[0])
    host = makers.thing("Host", [(0, y, 0) for y in (2.0, 0.0, -2.0)], [])
    host.location.x = 4
    host.modifiers.new("Scatter", "NODES").node_group = tree
    seen = makers.cloud(COLUMNS)
    assert names(seen, 0) == {"Stone"}
    assert len({number for y in (2, 0, -2) for number in numbers(seen, y)}) == 3
