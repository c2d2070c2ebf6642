"""Sensors as objects: properties of empties and cameras, which are saved in the .blend file."""

import json
from collections.abc import Iterator
from typing import Any

import bpy
import echocast as ec
import numpy as np
from mathutils import Matrix

#: Camera from sensor: a sensor looks along x with y to the left, a camera along -z with y up.
CAMERA = Matrix(((0, -1, 0, 0), (0, 0, 1, 0), (-1, 0, 0, 0), (0, 0, 0, 1)))

#: Keys of sensors that are not for changing.
HIDDEN = ("name", "title", "kind", "source", "driver", "expect")


def flattened(keys: "dict[str, Any]", prefix: str = "") -> "Iterator[tuple[str, Any]]":
    """Paths and values of nested keys; lists are values."""
    for key, value in keys.items():
        if isinstance(value, dict):
            yield from flattened(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def set_path(keys: "dict[str, Any]", path: str, value: Any) -> None:
    *sections, last = path.split(".")
    for section in sections:
        keys = keys.setdefault(section, {})
    keys[last] = value


class EchocastParameter(bpy.types.PropertyGroup):
    """A parameter of a sensor: `name` is its path, such as noise.range_sigma_m."""

    def changed(self, _context: Any) -> None:
        forget_sensor(self.id_data)

    kind: bpy.props.EnumProperty(
        items=[(name, name.title(), "") for name in ("NUMBER", "WHOLE", "SWITCH", "TEXT", "LIST")], name="Kind"
    )
    number: bpy.props.FloatProperty(name="Value", precision=6, update=changed)
    whole: bpy.props.IntProperty(name="Value", update=changed)
    switch: bpy.props.BoolProperty(name="Value", update=changed)
    text: bpy.props.StringProperty(name="Value", update=changed)
    #: As the preset has it, JSON: what is changed can be told, and set back.
    original: bpy.props.StringProperty()

    def field(self) -> str:
        return {"NUMBER": "number", "WHOLE": "whole", "SWITCH": "switch"}.get(self.kind, "text")

    def fill(self, path: str, value: Any) -> None:
        self.name, self.original = path, json.dumps(value)
        if isinstance(value, bool):
            self.kind, self.switch = "SWITCH", value
        elif isinstance(value, int) and abs(value) < 2**31:
            self.kind, self.whole = "WHOLE", value
        elif isinstance(value, (int, float)):
            self.kind, self.number = "NUMBER", value
        elif isinstance(value, str):
            self.kind, self.text = "TEXT", value
        else:
            self.kind, self.text = "LIST", json.dumps(value)

    def value(self) -> Any:
        original = json.loads(self.original)
        if self.kind == "LIST":
            try:
                return json.loads(self.text)
            except ValueError:
                raise ec.ArgumentError(f"{self.name} is {self.text!r}; allowed: JSON, such as {self.original}") from None
        value = getattr(self, self.field())
        # Blender keeps numbers in single precision.
        return original if self.kind == "NUMBER" and np.float32(original) == np.float32(value) else value

    def is_changed(self) -> bool:
        try:
            return self.value() != json.loads(self.original)
        except ec.Error:
            return True


def preset_names(_self: Any, _context: Any, text: str) -> "list[tuple[str, str]]":
    """Presets for a search by maker, name and kind: the name, and what it is."""
    words = text.lower().split()
    # A name that is there in full is no search.
    if any(text == name for name, _, _ in presets()):
        words = []
    found = [one for one in presets() if all(word in " ".join(one).lower() for word in words)]
    return [(name, f"{title} ({kind})") for name, title, kind in found]


PRESETS: "list[tuple[str, str, str]]" = []


def presets() -> "list[tuple[str, str, str]]":
    """Names, titles and kinds of the presets."""
    if not PRESETS:
        PRESETS.extend((name, title, ec.Sensor(name).kind) for name, title in ec.presets())
    return PRESETS


class EchocastSensor(bpy.types.PropertyGroup):
    """What makes an object a sensor."""

    def preset_changed(self, _context: Any) -> None:
        self.load_preset()

    is_sensor: bpy.props.BoolProperty(
        name="Sensor", description="Scan the scene from this object", default=False, options=set()
    )
    enabled: bpy.props.BoolProperty(name="Enabled", description="Whether scans use it", default=True, options=set())
    preset: bpy.props.StringProperty(
        name="Preset",
        description="The instrument: a preset, found by maker, name or kind (lidar, tof, sonar), or the path of a sensor file",
        search=preset_names,
        search_options={"SUGGESTION"},
        update=preset_changed,
    )
    parameters: bpy.props.CollectionProperty(type=EchocastParameter)
    section: bpy.props.StringProperty(name="Section", description="The section whose parameters are shown")
    fault: bpy.props.StringProperty(name="Fault")
    show_view: bpy.props.BoolProperty(
        name="Show Field of View", description="Draw its field of view in the viewport", default=True, options=set()
    )
    view_length: bpy.props.FloatProperty(
        name="Length", description="How long its field of view is drawn", default=5.0, min=0.01, subtype="DISTANCE"
    )

    def load_preset(self) -> None:
        """Fills the parameters with those of the preset."""
        forget_sensor(self.id_data)
        self.parameters.clear()
        self.fault = ""
        if not self.preset:
            return
        try:
            keys = ec.Sensor(bpy.path.abspath(self.preset)).to_dict()
        except ec.Error as error:
            self.fault = str(error)
            return
        for path, value in flattened(keys):
            if path.split(".")[0] not in HIDDEN:
                self.parameters.add().fill(path, value)
        sections = self.sections()
        if self.section not in sections:
            self.section = sections[0] if sections else ""

    def sections(self) -> "list[str]":
        return list(dict.fromkeys(one.name.split(".")[0] for one in self.parameters))

    def sensor(self) -> ec.Sensor:
        """The instrument; ec.Error if a parameter is not allowed."""
        if not self.preset:
            raise ec.ArgumentError(f"the sensor {self.id_data.name} has no preset; allowed: one of {len(presets())}")
        key = self.id_data.as_pointer()
        if key not in MADE:
            sensor = ec.Sensor(bpy.path.abspath(self.preset))
            changed = [one for one in self.parameters if one.is_changed()]
            if changed:
                keys = sensor.to_dict()
                # It says what the preset as it is should amount to.
                keys.pop("expect", None)
                for one in changed:
                    set_path(keys, one.name, one.value())
                sensor = ec.Sensor(keys)
            MADE[key] = sensor
        return MADE[key]


#: Instruments by pointers of their objects, until a parameter changes.
MADE: "dict[int, ec.Sensor]" = {}


def forget_sensor(thing: Any) -> None:
    MADE.pop(thing.as_pointer(), None)


@bpy.app.handlers.persistent
def forget_all(*_: Any) -> None:
    MADE.clear()


def all_of(scene: Any, only_enabled: bool = True) -> "list[Any]":
    """The sensors of a scene, by name."""
    found = [one for one in scene.objects if one.echocast.is_sensor and (one.echocast.enabled or not only_enabled)]
    return sorted(found, key=lambda one: one.name)


def pose(thing: Any, scale: float) -> Any:
    """World from sensor, 4 x 4, of an evaluated object, m. A scaled object is a sensor all the same."""
    place, rotation, _ = thing.matrix_world.decompose()
    matrix = Matrix.LocRotScale(place * scale, rotation, None)
    return np.array(matrix @ CAMERA if thing.type == "CAMERA" else matrix, dtype=np.float64)


CLASSES = (EchocastParameter, EchocastSensor)


def register() -> None:
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Object.echocast = bpy.props.PointerProperty(type=EchocastSensor)
    for name in ("undo_post", "redo_post", "load_post"):
        getattr(bpy.app.handlers, name).append(forget_all)


def unregister() -> None:
    for name in ("undo_post", "redo_post", "load_post"):
        getattr(bpy.app.handlers, name).remove(forget_all)
    del bpy.types.Object.echocast
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
    MADE.clear()
