"""Settings of scans, which are saved in the scene."""

from typing import Any

import bpy
import echocast as ec

COLUMNS = ("category_id", "intensity", "range", "instance_id", "part_id", "material_id")


class EchocastOutput(bpy.types.PropertyGroup):
    """A file that scans write."""

    def formats(self, _context: Any) -> "list[tuple[str, str, str]]":
        if not FORMATS:
            FORMATS.extend((name, name.upper(), what) for name, what in ec.formats())
        return FORMATS

    enabled: bpy.props.BoolProperty(name="Enabled", default=True, options=set())
    format: bpy.props.EnumProperty(name="Format", items=formats)
    path: bpy.props.StringProperty(
        name="Folder",
        description="Folder of the files; {sensor} stands for the name of the sensor",
        default="//scans",
        subtype="DIR_PATH",
        # Otherwise 4.5 and later warn.
        options={"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5) else set(),
    )


#: Blender needs the texts of dynamic enums to stay where they are.
FORMATS: "list[tuple[str, str, str]]" = []


class EchocastLayer(bpy.types.PropertyGroup):
    """A layer of water, down from its depth."""

    depth: bpy.props.FloatProperty(name="Depth", description="Of its upper side, m below the surface", min=0.0, soft_max=1000.0)
    speed: bpy.props.FloatProperty(name="Sound Speed", description="m/s", min=1300.0, max=1700.0, default=1500.0)
    density: bpy.props.FloatProperty(name="Density", description="kg/m^3", min=900.0, max=1400.0, default=1025.0)


class EchocastScene(bpy.types.PropertyGroup):
    """How the scene is scanned."""

    def color_changed(self, _context: Any) -> None:
        # It imports this module.
        from . import clouds

        clouds.paint_again(self.id_data)

    frames: bpy.props.EnumProperty(
        name="Frames",
        items=[
            ("CURRENT", "Current Frame", "Scan the scene as it is now"),
            ("RANGE", "Frame Range", "Scan each frame of the range of the scene"),
        ],
        options=set(),
    )
    step: bpy.props.IntProperty(name="Step", description="Frames from scan to scan", default=1, min=1, options=set())
    motion: bpy.props.BoolProperty(
        name="Motion During Scans",
        description="Objects and sensors move while a scan is made, as the animation has it, each beam at its own time",
        default=True,
        options=set(),
    )
    seed: bpy.props.IntProperty(name="Seed", description="Of all random draws", default=0, min=0, options=set())
    noise: bpy.props.BoolProperty(name="Noise", description="Errors of the instruments", default=True, options=set())
    profile: bpy.props.EnumProperty(
        name="Profile",
        items=[
            ("physical", "Physical", "As the instruments work"),
            ("paper", "Paper", "Equations as printed in the paper"),
            ("blainder", "Blainder", "As computed by the paper's program"),
        ],
        options=set(),
    )
    columns: bpy.props.StringProperty(
        name="Columns", description="Columns of the points: default, all, or names with commas", default="default", options=set()
    )
    color: bpy.props.StringProperty(
        name="Colour By",
        description="The column that colours points",
        default="category_id",
        update=color_changed,
        search=lambda _self, _context, _text: list(COLUMNS),
        search_options={"SUGGESTION"},
        options=set(),
    )
    clouds: bpy.props.BoolProperty(name="Point Clouds", description="Add an object for each scan", default=True, options=set())
    images: bpy.props.BoolProperty(name="Images", description="Add images of cameras and sonars", default=True, options=set())
    radius: bpy.props.FloatProperty(
        name="Point Radius", default=0.02, min=0.0001, precision=4, subtype="DISTANCE", options=set()
    )
    outputs: bpy.props.CollectionProperty(type=EchocastOutput)
    output: bpy.props.IntProperty()

    fog: bpy.props.BoolProperty(name="Fog", options=set())
    visibility: bpy.props.FloatProperty(
        name="Visibility", description="Meteorological optical range, m", default=100.0, min=1.0, max=50000.0, options=set()
    )
    rain: bpy.props.BoolProperty(name="Rain", options=set())
    rain_rate: bpy.props.FloatProperty(name="Rate", description="mm/h", default=10.0, min=0.0, max=200.0, options=set())
    snow: bpy.props.BoolProperty(name="Snow", options=set())
    snow_rate: bpy.props.FloatProperty(name="Rate", description="mm/h", default=2.0, min=0.0, max=50.0, options=set())
    water: bpy.props.BoolProperty(name="Water", description="Water for sonars", default=False, options=set())
    surface: bpy.props.FloatProperty(name="Surface", description="Height of the surface", subtype="DISTANCE", options=set())
    temperature: bpy.props.FloatProperty(name="Temperature", description="degrees Celsius", default=10.0, min=-2.0, max=40.0, options=set())
    salinity: bpy.props.FloatProperty(name="Salinity", description="PSU", default=35.0, min=0.0, max=45.0, options=set())
    layers: bpy.props.CollectionProperty(type=EchocastLayer)
    layer: bpy.props.IntProperty()
    keys: bpy.props.PointerProperty(
        name="More", description="A text with further keys of the environment, as YAML", type=bpy.types.Text
    )

    notes: bpy.props.StringProperty(name="Notes", description="What the last scan reported, JSON")

    def environment(self, scale: float) -> ec.Environment:
        """Weather and water; ec.Error for values that are not allowed. `scale`: metres per unit."""
        keys: "dict[str, Any]" = {}
        if self.keys is not None and self.keys.as_string().strip():
            try:
                # The line break says that it is YAML, not the name of a file.
                keys.update(ec.Environment(self.keys.as_string() + "\n").to_dict())
            except ec.Error as error:
                raise ec.ArgumentError(f"the text {self.keys.name}: {error}") from error
        if self.fog:
            keys["fog"] = {"visibility_m": self.visibility}
        if self.rain:
            keys["rain"] = {"rate_mm_h": self.rain_rate}
        if self.snow:
            keys["snow"] = {"rate_mm_h": self.snow_rate}
        if self.water:
            water = keys.setdefault("water", {})
            water["surface_z_m"] = self.surface * scale
            if self.layers:
                layers = sorted(self.layers, key=lambda layer: layer.depth)
                rows = [{"depth_m": one.depth, "speed_m_s": one.speed, "density_kg_m3": one.density} for one in layers]
                water["profile"] = {"layers": rows}
            else:
                water.update(temperature_c=self.temperature, salinity_psu=self.salinity)
        return ec.Environment(keys)


CLASSES = (EchocastOutput, EchocastLayer, EchocastScene)


def register() -> None:
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Scene.echocast = bpy.props.PointerProperty(type=EchocastScene)


def unregister() -> None:
    del bpy.types.Scene.echocast
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
