"""The scene of Blender in echocast, kept up to date: what has not changed is not read again."""

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy
import echocast as ec
import numpy as np

from . import evaluated, geometry, labels, materials

#: Objects that hold results of scans have this custom property; they are not scanned.
RESULT = "echocast_scan"

#: Positions and scales beyond this, m, are mistakes.
FARTHEST = 1e12

#: What a persistent id has where a level of instancing has no index: the mesh of a curve, a text or a metaball.
NO_INDEX = 2**31 - 1


@dataclass
class Seen:
    """An object of echocast, and what it was made from."""

    number: int
    mesh: ec.Mesh
    pose: bytes
    category: int
    instance: int
    parts: "tuple[int, ...]"


@dataclass
class Found:
    """An instance of a mesh in a depsgraph."""

    key: "tuple[Any, ...]"
    name: str
    mesh: ec.Mesh
    pose: Any
    identity: labels.Identity
    owner: "tuple[Any, ...]"
    #: Part names of its materials.
    parts: "tuple[str, ...]"


@dataclass
class Shape:
    """A mesh that has been read, and what it was read from."""

    mesh: "ec.Mesh | None"
    parts: "tuple[str, ...]"
    materials: "tuple[Any, ...]"
    #: Whether Blender reports when it changes: not what only rendering sees.
    watched: bool
    #: The name of its object, and those of materials with an image on a UV map that it does not have.
    name: str = ""
    unmapped: "tuple[str, ...]" = ()
    #: Why it cannot be scanned.
    fault: "str | None" = None


@dataclass
class Changes:
    """What has changed in Blender since the last export: pointers of original data."""

    geometry: "set[int]" = field(default_factory=set)
    materials: "set[int]" = field(default_factory=set)
    everything: bool = False


class ExportedScene:
    """A scene of Blender and a view layer, as a LiveScene."""

    def __init__(self) -> None:
        self.live = ec.LiveScene()
        self.seen: "dict[tuple[Any, ...], Seen]" = {}
        self.shapes: "dict[tuple[Any, ...], Shape]" = {}
        self.read: "dict[int, materials.Read]" = {}
        self.categories, self.parts = labels.Numbers(), labels.Numbers()
        #: Numbers of instances by what makes them one, and their names.
        self.instance_numbers: "dict[tuple[Any, ...], int]" = {}
        self.instance_names: "dict[int, str]" = {}
        self.changes = Changes(everything=True)
        self.notes: "list[str]" = []
        #: Keys of objects whose vertices moved during the last scan.
        self.deformed: "set[tuple[Any, ...]]" = set()
        #: Names of labels that are set, with their table and number.
        self.named: "set[tuple[str, int, str]]" = set()

    def update(self, context: Any) -> None:
        """Brings it to what Blender has now."""
        # Blender reports changes when it evaluates them.
        context.evaluated_depsgraph_get()
        changes, self.changes = self.changes, Changes()
        if changes.everything:
            self.read.clear()
            self.shapes.clear()
        for pointer in changes.materials:
            self.read.pop(pointer, None)
        found: "list[Found]" = []
        self.notes = []
        try:
            evaluated.visit(context, lambda depsgraph: found.extend(self.find(depsgraph, changes)))
            self.deformed.clear()
            self.live.set_time(0.0)
            self.apply(found)
        except BaseException:
            # The next update begins anew.
            self.changes.everything = True
            raise

    # --- reading --------------------------------------------------------------------------------------------------

    def find(self, depsgraph: Any, changes: Changes) -> "list[Found]":
        metres = to_metres(depsgraph)
        all_differ = evaluated.scene_differs(depsgraph.scene)
        of_pointer: "dict[tuple[Any, ...], Shape]" = {}
        kept: "dict[tuple[Any, ...], Shape]" = {}
        identities: "dict[Any, labels.Identity]" = {}
        groups = labels.Groups()
        found, faults = [], {}
        # What Blender makes no mesh of, by names of objects.
        unseen: "dict[tuple[str, str], None]" = {}
        for instance in evaluated.instances(depsgraph):
            thing = instance.object
            original = thing.original
            instancer = instance.parent.original if instance.is_instance and instance.parent else None
            if RESULT in original or instancer is not None and RESULT in instancer:
                continue
            if (what := evaluated.without_mesh(thing)) is not None:
                unseen[original.name, what] = None
            if thing.type != "MESH" or not instance.show_self:
                continue
            key = key_of(instance)
            slots = slot_materials(thing)
            # Meshes are shared by instances of one object, and by objects of one mesh without modifiers.
            pointer = (thing.data.as_pointer(), tuple(slot.as_pointer() if slot else 0 for slot in slots))
            shape = of_pointer.get(pointer)
            if shape is None:
                shape = self.shape(key, thing, original, instancer, slots, changes, all_differ)
                of_pointer[pointer] = shape
            kept[key] = shape
            if shape.fault:
                faults[original.name] = shape.fault
            if shape.mesh is None:
                continue
            identified = (key[:2], slots)
            if identified not in identities:
                identities[identified] = labels.Identity(original, instancer, list(slots), groups)
            identity = identities[identified]
            parts = (identity.part,) * max(1, len(slots)) if identity.part is not None else shape.parts
            pose = metres @ np.array(instance.matrix_world, dtype=np.float64)
            if not (np.abs(pose) < FARTHEST).all():
                faults[original.name] = f"its matrix has numbers that are not finite, or above {FARTHEST:g}"
                continue
            # Each particle and each instance that nodes make is one by itself, and so is each instance of a collection.
            numbers = instance.persistent_id
            if instancer is not None and (instancer != original or numbers[1] != NO_INDEX):
                pieces = 0 if instance.particle_system else identity.innermost
                within = identity.within.as_pointer() if identity.within else 0
                owner = (instancer.as_pointer(), within, *(one for one in numbers[pieces:] if one != NO_INDEX))
            else:
                owner = (identity.owner.as_pointer(),)
            found.append(Found(key, original.name, shape.mesh, pose, identity, owner, parts))
        self.shapes = kept
        self.notes += [f"{name} is left out: {fault}" for name, fault in faults.items()]
        self.notes += [f"the {what} of {name} are not scanned: Blender makes no mesh of them" for name, what in unseen]
        self.notes += without_maps(of_pointer.values())
        self.notes += [f"the library {path} is missing: what it holds is not seen" for path in missing_libraries()]
        used = dict.fromkeys(one for shape in of_pointer.values() for one in shape.materials)
        self.notes += [sentence for one in used for sentence in self.read[one].notes]
        return found

    def shape(
        self,
        key: "tuple[Any, ...]",
        thing: Any,
        original: Any,
        instancer: Any,
        slots: "tuple[Any, ...]",
        changes: Changes,
        all_differ: bool,
    ) -> Shape:
        """The mesh of an evaluated object: as it was read before, unless it has changed. `all_differ`: whether rendering
        may see any object in another shape than the viewport."""
        pointers = tuple(slot.as_pointer() if slot else 0 for slot in slots)
        known = self.shapes.get(key)
        sources = [original, instancer] if instancer is not None else [original]
        changed = key in self.deformed or any(is_changed(one, changes) for one in sources)
        watched = not all_differ and not any(evaluated.object_differs(one) for one in sources)
        if known is not None and known.watched and watched and not changed:
            if known.materials == pointers and not any(pointer in changes.materials for pointer in pointers):
                return known
        read = [self.material(slot) for slot in slots] or [self.material(None)]
        parts = tuple(one.part if one.part is not None else name(slot) for one, slot in zip(read, slots or (None,)))
        try:
            mesh = geometry.mesh_of(original.name, thing.data, read)
            unmapped = (name(slot) for one, slot in zip(read, slots) if not geometry.has_map(thing.data, one))
            return Shape(mesh, parts, pointers, watched, original.name, tuple(unmapped) if mesh is not None else ())
        except (geometry.Unusable, ec.Error) as fault:
            return Shape(None, parts, pointers, watched, fault=str(fault))

    def material(self, slot: Any) -> materials.Read:
        pointer = slot.as_pointer() if slot else 0
        if pointer not in self.read:
            self.read[pointer] = materials.read(slot)
        return self.read[pointer]

    def has_changed(self, instance: Any) -> bool:
        """Whether the shape of an instance may have changed since the last update."""
        sources = [instance.object.original]
        if instance.is_instance and instance.parent:
            sources.append(instance.parent.original)
        return any(is_changed(one, self.changes) or evaluated.object_differs(one) for one in sources)

    def name(self, key: "tuple[Any, ...]") -> str:
        return self.live.objects[self.seen[key].number]

    def places(self, keys: "set[tuple[Any, ...]]", context: Any) -> "dict[tuple[Any, ...], Any]":
        """Positions of the vertices of objects as they are evaluated now."""
        found: "dict[tuple[Any, ...], Any]" = {}

        def look(depsgraph: Any) -> None:
            for instance in evaluated.instances(depsgraph):
                key = key_of(instance)
                if key in keys:
                    found[key] = geometry.vertices(instance.object.data)

        evaluated.visit(context, look)
        return found

    # --- to echocast ----------------------------------------------------------------------------------------------

    def apply(self, found: "list[Found]") -> None:
        self.number(found)
        keys = {one.key for one in found}
        for key in [key for key in self.seen if key not in keys]:
            self.live.remove(self.seen.pop(key).number)
        for one in found:
            category = self.categories[one.identity.category]
            instance = self.instance_numbers[one.owner]
            parts = tuple(self.parts[part] for part in one.parts)
            pose = one.pose.tobytes()
            before = self.seen.get(one.key)
            if before is not None and (before.mesh is not one.mesh or before.parts != parts):
                self.live.remove(before.number)
                before = None
            if before is None:
                number = self.live.add_mesh(
                    one.mesh, pose=one.pose, category=category, instance=instance, parts=parts, name=one.name
                )
                self.seen[one.key] = Seen(number, one.mesh, pose, category, instance, parts)
                continue
            if before.pose != pose:
                self.live.set_pose(before.number, one.pose)
                before.pose = pose
            if (before.category, before.instance) != (category, instance):
                self.live.set_labels(before.number, category=category, instance=instance)
                before.category, before.instance = category, instance
        self.name_labels()

    def number(self, found: "list[Found]") -> None:
        self.categories.assign({one.identity.category for one in found})
        self.parts.assign({part for one in found for part in one.parts})
        # In the order of the depsgraph; numbers of what stays are kept.
        known = self.instance_numbers
        owners = dict.fromkeys(one.owner for one in found)
        last = max(known.values(), default=0)
        numbers = {owner: known[owner] for owner in owners if owner in known}
        for owner in owners:
            if owner not in numbers:
                last += 1
                numbers[owner] = last
        self.instance_numbers = numbers
        self.instance_names = {numbers[one.owner]: one.identity.name for one in reversed(found)}

    def name_labels(self) -> None:
        tables: "dict[Any, dict[int, str]]" = {
            "category": {number: name for name, number in self.categories.of.items()},
            "part": {number: name for name, number in self.parts.of.items()},
            "instance": self.instance_names,
        }
        for table, names in tables.items():
            for number, name in names.items():
                if number and (table, number, name) not in self.named:
                    self.live.name_label(table, number, name)
                    self.named.add((table, number, name))


def made_by(thing: Any) -> "dict[str, Any]":
    """What a cloud says of its scan: `sensor`, `frame`, `color`; nothing if somebody has changed that."""
    try:
        found = json.loads(thing[RESULT])
    except (KeyError, TypeError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def without_maps(shapes: "Iterable[Shape]") -> "list[str]":
    """Sentences about materials with an image on a UV map that meshes do not have."""
    objects: "dict[str, dict[str, None]]" = {}
    for shape in shapes:
        for material in shape.unmapped:
            objects.setdefault(material, {})[shape.name] = None
    told = []
    for material, names in objects.items():
        first, *more = names
        others = f" and {len(more)} more" if more else ""
        what = f"the UV map of its image is missing in {first}{others}: it is white there, or on the map that is rendered"
        told.append(f"material {material}: {what}")
    return told


def to_metres(depsgraph: Any) -> Any:
    """4 x 4, from units of the scene."""
    scale = depsgraph.scene.unit_settings.scale_length
    return np.diag([scale, scale, scale, 1.0])


def key_of(instance: Any) -> "tuple[Any, ...]":
    """What an instance is known by from one evaluation to the next."""
    original = instance.object.original.as_pointer()
    if not instance.is_instance:
        return (original,)
    return (original, instance.parent.original.as_pointer() if instance.parent else 0, *instance.persistent_id)


def slot_materials(thing: Any) -> "tuple[Any, ...]":
    """The original materials of an evaluated mesh, as they render: those of its data, which nodes may add to, unless slots
    of the object replace them."""
    materials = (slot.material for slot in thing.material_slots)
    return tuple(one.original if one is not None else None for one in materials)


def missing_libraries() -> "list[str]":
    paths = [bpy.path.abspath(library.filepath) for library in bpy.data.libraries if library.packed_file is None]
    return [path for path in paths if not Path(path).exists()]


def is_changed(thing: Any, changes: Changes) -> bool:
    data = thing.data
    return thing.as_pointer() in changes.geometry or data is not None and data.as_pointer() in changes.geometry


def name(material: Any) -> str:
    return material.name if material is not None else ""


# --- the scenes of this session of Blender ------------------------------------------------------------------------

EXPORTED: "dict[tuple[int, str], ExportedScene]" = {}


def exported(context: Any) -> ExportedScene:
    """The scene and view layer of `context` in echocast, up to date."""
    key = (context.scene.as_pointer(), context.view_layer.name)
    scene = EXPORTED.setdefault(key, ExportedScene())
    scene.update(context)
    return scene


@bpy.app.handlers.persistent
def note_changes(scene: Any, depsgraph: Any = None) -> None:
    """Records what Blender has evaluated anew."""
    # For rendering everything is evaluated anew, whether it has changed or not.
    if depsgraph is None or depsgraph.mode == "RENDER":
        return
    for update in depsgraph.updates:
        thing = update.id.original
        pointer = thing.as_pointer()
        for exported_scene in EXPORTED.values():
            changes = exported_scene.changes
            if isinstance(thing, bpy.types.Material):
                changes.materials.add(pointer)
            elif isinstance(thing, (bpy.types.NodeTree, bpy.types.Image)):
                changes.materials.update(exported_scene.read)
            elif update.is_updated_geometry:
                changes.geometry.add(pointer)


@bpy.app.handlers.persistent
def forget(*_: Any) -> None:
    """After undo, redo and loading, data may be elsewhere in memory."""
    EXPORTED.clear()


HANDLERS = (
    ("depsgraph_update_post", note_changes),
    ("frame_change_post", note_changes),
    ("undo_post", forget),
    ("redo_post", forget),
    ("load_post", forget),
)


def register() -> None:
    bpy.utils.register_class(evaluated.EchocastRenderEngine)
    for name, handler in HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)


def unregister() -> None:
    for name, handler in HANDLERS:
        getattr(bpy.app.handlers, name).remove(handler)
    bpy.utils.unregister_class(evaluated.EchocastRenderEngine)
    EXPORTED.clear()
