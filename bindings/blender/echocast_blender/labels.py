"""Labels: categories, parts and instances, from custom properties as the paper's add-on has them, else from names."""

import re
from typing import Any

import bpy

from .materials import label

#: Types of objects that have no mesh.
BARE = ("EMPTY", "ARMATURE", "LATTICE", "CAMERA", "LIGHT", "LIGHT_PROBE", "SPEAKER")
#: An object with more pieces is taken for a group of things.
MOST_PIECES = 64

#: `Chair.001`, as Blender names copies.
COPY = re.compile(r"(.+)\.\d{3,}")


def without_copy_number(name: str) -> str:
    found = COPY.fullmatch(name)
    return found[1] if found else name


def ancestry(thing: Any) -> "list[Any]":
    """An object and its parents, the nearest first."""
    chain = []
    while thing is not None and thing not in chain:
        chain.append(thing)
        thing = thing.parent
    return chain


class Groups:
    """Which objects only group others, as in files (docs/files.md, Labels)."""

    def __init__(self) -> None:
        self.known: "dict[Any, bool]" = {}
        self.pieces: "dict[Any, dict[Any, None]] | None" = None

    def __contains__(self, thing: Any) -> bool:
        if thing not in self.known:
            bare = thing.type in BARE and thing.instance_type != "COLLECTION" and "categoryID" not in thing
            self.known[thing] = bare and (is_at_origin(thing) or self.holds_a_group(thing))
        return self.known[thing]

    def holds_a_group(self, thing: Any) -> bool:
        """Whether an object contains one other group, and nothing else, or very many pieces."""
        if self.pieces is None:
            self.pieces = pieces()
        held = self.pieces.get(thing, {})
        return len(held) > MOST_PIECES or len(held) == 1 and next(iter(held)) in self


def is_at_origin(thing: Any) -> bool:
    """Whether an object has the same origin as its parent, and stays there."""
    return max(map(abs, thing.matrix_local.translation)) < 1e-6 and not thing.constraints and "location" not in animated(thing)


def animated(thing: Any) -> "set[str]":
    """Paths of the properties of an object that its animation changes."""
    data = thing.animation_data
    if data is None:
        return set()
    action, curves = data.action, list(data.drivers)
    if hasattr(action, "layers"):
        strips = [strip for layer in action.layers for strip in layer.strips]
        bags = [bag for strip in strips for bag in strip.channelbags if bag.slot_handle == data.action_slot_handle]
        curves += [curve for bag in bags for curve in bag.fcurves]
    elif action is not None:
        curves += action.fcurves
    return {curve.data_path for curve in curves}


def pieces() -> "dict[Any, dict[Any, None]]":
    """The children of objects that have a mesh, or something with a mesh below them."""
    found: "dict[Any, dict[Any, None]]" = {}
    for thing in bpy.data.objects:
        if thing.type in BARE and thing.instance_type != "COLLECTION":
            continue
        while thing.parent is not None and thing not in found.setdefault(thing.parent, {}):
            found[thing.parent][thing] = None
            thing = thing.parent
    return found


class Identity:
    """Category of an object that is seen, and the object that makes one instance of it and what belongs to it."""

    def __init__(self, seen: Any, instancer: Any, materials: "list[Any]", groups: Groups) -> None:
        """`seen`: the original object; `instancer`: that which made an instance of it, or None; `materials`: those of
        its slots, original."""
        own = ancestry(seen)
        chain = own + (ancestry(instancer) if instancer is not None and instancer != seen else [])
        giver = next((one for one in chain if "categoryID" in one), None)
        of_material = next((one["categoryID"] for one in materials if one is not None and "categoryID" in one), None)
        outermost = next((one for one in reversed(own) if one not in groups), seen)
        #: The object that all that belongs to it is one instance with, if no instancer makes several of it.
        self.owner = giver or outermost
        #: Within an instance of a collection, the object that is an instance by itself; None: all of it is one.
        self.within = giver if giver in own else None
        whole = instancer is not None and instancer.instance_type == "COLLECTION"
        self.name = (self.within or (instancer if whole else self.owner)).name
        #: How many of the innermost numbers of an instance only tell the pieces of a collection apart: that of the object
        #: in it, and for curves and the like that of their mesh.
        self.innermost = 1 if seen.type == "MESH" else 2
        if any(one.instance_type in ("VERTS", "FACES") for one in own[1:]):
            self.innermost = 0
        if giver is not None:
            self.category = label(giver["categoryID"])
        elif of_material is not None:
            self.category = label(of_material)
        else:
            self.category = without_copy_number(outermost.name)
        parts = next((one["partID"] for one in chain if "partID" in one), None)
        #: The part that the object is; None: its materials decide.
        self.part = None if parts is None else label(parts)


class Numbers:
    """Numbers of names, from 1. A name that is a whole number is that number; it keeps it over the life of the table."""

    def __init__(self) -> None:
        self.of: "dict[str, int]" = {}

    def assign(self, names: "set[str]") -> None:
        """Gives numbers to names that have none: to numbers themselves first, then in the order of the alphabet."""
        new = sorted(names - self.of.keys() - {""})
        whole = [name for name in new if name.isdecimal() and 0 < int(name) < 2**32 and str(int(name)) == name]
        taken = set(self.of.values())
        for name in whole:
            # Another name may have the number already: then both are the same label.
            self.of[name] = int(name)
            taken.add(int(name))
        next_free = 1
        for name in new:
            if name in self.of or name == "0":
                continue
            while next_free in taken:
                next_free += 1
            self.of[name] = next_free
            taken.add(next_free)

    def __getitem__(self, name: str) -> int:
        return self.of.get(name, 0)
