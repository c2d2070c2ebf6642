"""Sensors as objects: properties of empties and cameras, which are saved in the .blend file."""

import functools
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

    kind: bpy.props.EnumProperty(
        items=[(name, name.title(), "") for name in ("NUMBER", "WHOLE", "SWITCH", "TEXT", "LIST")], name="Kind"
    )
    number: bpy.props.FloatProperty(name="Value", precision=6)
    whole: bpy.props.IntProperty(name="Value")
    switch: bpy.props.BoolProperty(name="Value")
    text: bpy.props.StringProperty(name="Value")
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
        value = getattr(self, self.field())
        if self.kind == "LIST":
            try:
                return json.loads(value)
            except ValueError:
                raise ec.ArgumentError(f"{self.name} is {value!r}; allowed: JSON, such as {self.original}") from None
        if self.kind == "NUMBER":
            original = json.loads(self.original)
            # Blender keeps numbers in single precision: this is the shortest of those that it may stand for.
            return original if np.float32(value) == np.float32(original) else float(str(np.float32(value)))
        return value

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
        description="The instrument: a preset, found by maker, name or kind (lidar, tof, sonar, radar), or the path of a sensor file",
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
        # A file may have changed.
        instrument.cache_clear()
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

    def set_parameter(self, path: str, value: Any) -> None:
        one = next(one for one in self.parameters if one.name == path)
        setattr(one, one.field(), json.dumps(value) if one.kind == "LIST" else value)

    def sections(self) -> "list[str]":
        return list(dict.fromkeys(one.name.split(".")[0] for one in self.parameters))

    def sensor(self) -> ec.Sensor:
        """The instrument; ec.Error if a parameter is not allowed."""
        if not self.preset:
            raise ec.ArgumentError(f"the sensor {self.id_data.name} has no preset; allowed: one of {len(presets())}")
        changes = tuple((one.name, json.dumps(one.value())) for one in self.parameters if one.is_changed())
        return instrument(bpy.path.abspath(self.preset), changes)


@functools.lru_cache(maxsize=64)
def instrument(preset: str, changes: "tuple[tuple[str, str], ...]") -> ec.Sensor:
    """A preset with changes: paths of keys, and their values as JSON."""
    sensor = ec.Sensor(preset)
    if not changes:
        return sensor
    keys = sensor.to_dict()
    # It says what the preset as it is should amount to.
    keys.pop("expect", None)
    for path, value in changes:
        set_path(keys, path, json.loads(value))
    return ec.Sensor(keys)


#: Errors of measurement, by their paths in sensor files: sections, and numbers.
ERROR_SECTIONS = ("noise", "tof.shot_noise", "tof.depth_noise")
ERROR_NUMBERS = (
    "tof.lateral_sigma_px",
    "tof.wiggle_residual",
    "doppler.sigma_m_s",
    "dvl.sigma_m_s",
    "dvl.sigma_per_m_s",
    "dvl.scale_sigma",
    "dvl.bias_sigma_m_s",
    "dvl.water.sigma_m_s",
)


def without_errors(sensor: ec.Sensor) -> ec.Sensor:
    """The instrument, but ideal."""
    keys = sensor.to_dict()
    keys.pop("expect", None)
    for path in (*ERROR_SECTIONS, *ERROR_NUMBERS):
        *sections, last = path.split(".")
        holder = functools.reduce(lambda one, section: one.get(section, {}), sections, keys)
        if last in holder and path in ERROR_SECTIONS:
            del holder[last]
        elif last in holder:
            holder[last] = 0.0
    return ec.Sensor(keys)


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


def unregister() -> None:
    del bpy.types.Object.echocast
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
    instrument.cache_clear()
