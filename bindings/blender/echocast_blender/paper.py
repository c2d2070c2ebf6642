"""Takes over the settings that the add-on of the paper has left in a .blend file (BLAINDER range scanner; names and defaults
are those of its properties)."""

import json
import math
from typing import Any

import bpy

from . import sensors

GROUP = "scannerProperties"

#: What holds where nothing is stored: Blender stores only what was set.
DEFAULTS: "dict[str, Any]" = {
    "scannerObject": None,
    "scannerType": 0,
    "reflectivityLower": 0.1,
    "distanceLower": 50.0,
    "reflectivityUpper": 0.9,
    "distanceUpper": 120.0,
    "fovX": 90.0,
    "fovY": 45.0,
    "xStepDegree": 1.0,
    "yStepDegree": 1.0,
    "rotationsPerSecond": 10.0,
    "resolutionX": 320,
    "resolutionY": 240,
    "resolutionPercentage": 100,
    "fovSonar": 45.0,
    "sonarStepDegree": 1.0,
    "sourceLevel": 200.0,
    "noiseLevel": 50.0,
    "directivityIndex": 20.0,
    "processingGain": 10.0,
    "receptionThreshold": 10.0,
    "maxDistance": 100.0,
    "simulateWaterProfile": False,
    "surfaceHeight": 10.0,
    "enableAnimation": False,
    "frameStart": 1,
    "frameEnd": 10,
    "frameStep": 1,
    "addNoise": True,
    "mu": 0.0,
    "sigma": 0.01,
    "addConstantNoise": True,
    "noiseAbsoluteOffset": 0.0,
    "noiseRelativeOffset": 0.0,
    "simulateRain": False,
    "rainfallRate": 10.0,
    "simulateDust": False,
    "particleRadius": 50.0,
    "particlesPcm": 1e5,
    "dustCloudStart": 5.0,
    "dustCloudLength": 12.5,
    "exportLAS": False,
    "exportHDF": False,
    "exportCSV": False,
    "exportPLY": False,
    "dataFilePath": "",
}
STATIC, ROTATING, SIDE_SCAN = 0, 1, 2
PRESETS = {STATIC: "kinect_v1_default", ROTATING: "generic_lidar", SIDE_SCAN: "generic_sonar"}


def stored(scene: Any, name: str) -> Any:
    """What an add-on that is not there has stored in the scene."""
    if name in scene:
        return scene[name]
    # Where Blender 5.0 and later keep what they have saved themselves.
    system = getattr(scene, "bl_system_properties_get", None)
    kept = system() if system else None
    return kept[name] if kept is not None and name in kept else None


def take_over(scene: Any) -> "list[str]":
    """Makes a sensor of the settings of the paper's add-on, if the scene has any and has no sensor yet; returns what was
    taken over."""
    group = stored(scene, GROUP)
    if group is None or sensors.all_of(scene, only_enabled=False):
        return []
    group = group.to_dict() if hasattr(group, "to_dict") else dict(group)
    # Values of another type are of another version; Blender ignores them, too.
    found = {key: group[key] if is_like(group.get(key), default) else default for key, default in DEFAULTS.items()}
    camera, kind = found["scannerObject"], found["scannerType"]
    if camera is None or camera.name not in scene.objects:
        return ["settings of the BLAINDER range scanner are there, but no camera for them: they are not used"]
    if kind not in PRESETS:
        return [f"settings of the BLAINDER range scanner are not used: scannerType is {kind}; allowed: 0 to {len(PRESETS) - 1}"]
    own, wanted = camera.echocast, scene.echocast
    own.is_sensor = True
    own.preset = PRESETS[kind]
    changes = sonar(found) if kind == SIDE_SCAN else {**light(found), **noise(found)}
    for path, value in changes.items():
        own.set_parameter(path, value)
    wanted.profile = "blainder"
    told = [f"the camera {camera.name} is a sensor with the settings of the BLAINDER range scanner; the profile is blainder"]
    # Keys of the environment that the panel does not have.
    more: "dict[str, Any]" = {}
    if kind == SIDE_SCAN:
        wanted.water, wanted.surface = True, found["surfaceHeight"]
        layers = stored(scene, "custom") if found["simulateWaterProfile"] else None
        more.update(water_layers(wanted, layers or ()))
        if noise(found):
            told.append("errors of the range are not taken over: sonars have none")
    else:
        if found["simulateRain"]:
            wanted.rain, wanted.rain_rate = True, found["rainfallRate"]
        if found["simulateDust"]:
            cloud = {"radius_um": found["particleRadius"], "per_m3": found["particlesPcm"]}
            more["dust"] = {**cloud, "start_m": found["dustCloudStart"], "length_m": found["dustCloudLength"]}
    if more:
        wanted.keys = bpy.data.texts.new("Environment of the BLAINDER range scanner")
        wanted.keys.from_string(json.dumps(more))
    if found["enableAnimation"]:
        wanted.frames, wanted.step = "RANGE", max(1, found["frameStep"])
        told.append(f"frames {found['frameStart']} to {found['frameEnd']} were scanned: the range of the scene is used now")
    for key, format in (("exportLAS", "las"), ("exportHDF", "hdf5"), ("exportCSV", "csv"), ("exportPLY", "ply")):
        if found[key]:
            output = wanted.outputs.add()
            output.format, output.path = format, found["dataFilePath"] or "//"
    wanted.notes = json.dumps(told)
    return told


def is_like(value: Any, default: Any) -> bool:
    """Whether a stored value is of the type that the setting has."""
    kind = bpy.types.Object if default is None else str if isinstance(default, str) else (int, float)
    return isinstance(value, kind)


def water_layers(wanted: Any, layers: Any) -> "dict[str, Any]":
    """Adds the layers to the list in the panel; where they are not of water, but indices of refraction as in the paper's
    preset, returns them as keys of an environment."""
    names = {"depth": "depth_m", "speed": "speed_m_s", "density": "density_kg_m3"}
    rows = sorted(([float(one.get(key, 0.0)) for key in names] for one in layers), key=lambda row: row[0])
    if any(not 1300 <= speed <= 1700 or not 900 <= density <= 1400 for _, speed, density in rows):
        profile = {"layers": [dict(zip(names.values(), row)) for row in rows]}
        return {"water": {"allow_unphysical": True, "profile": profile}}
    for row in rows:
        layer = wanted.layers.add()
        layer.depth, layer.speed, layer.density = row
    return {}


def light(found: "dict[str, Any]") -> "dict[str, Any]":
    changes = {
        "range.max_m": found["distanceUpper"],
        "detection.lower.reflectance": found["reflectivityLower"],
        "detection.lower.at_m": found["distanceLower"],
        "detection.upper.reflectance": found["reflectivityUpper"],
        "detection.upper.at_m": found["distanceUpper"],
    }
    x, y = found["fovX"], found["fovY"]
    if found["scannerType"] == ROTATING:
        changes.update({
            "pattern.azimuth.fov_deg": x,
            "pattern.azimuth.step_deg": found["xStepDegree"],
            "pattern.azimuth.rate_hz": found["rotationsPerSecond"],
            "pattern.elevation.fov_deg": y,
            "pattern.elevation.step_deg": found["yStepDegree"],
        })
        return changes
    part = found["resolutionPercentage"] / 100
    resolution = [max(1, int(found[key] * part)) for key in ("resolutionX", "resolutionY")]
    # It uses the ratio of the two angles as the aspect ratio of the image.
    vertical = 2 * math.degrees(math.atan(y / x * math.tan(math.radians(x) / 2)))
    changes.update({"pattern.resolution": resolution, "pattern.fov_deg": [x, vertical]})
    return changes


def sonar(found: "dict[str, Any]") -> "dict[str, Any]":
    return {
        "pattern.down_fov_deg": found["fovSonar"],
        "pattern.step_deg": found["sonarStepDegree"],
        "range.max_m": found["maxDistance"],
        "acoustics.source_level_db": found["sourceLevel"],
        "acoustics.noise_level_db": found["noiseLevel"],
        "acoustics.directivity_index_db": found["directivityIndex"],
        "acoustics.processing_gain_db": found["processingGain"],
        "acoustics.detection_threshold_db": found["receptionThreshold"],
    }


def noise(found: "dict[str, Any]") -> "dict[str, Any]":
    """Presets of the paper have no errors: only those that there are."""
    changes = {}
    if found["addNoise"]:
        changes.update({"noise.range_mean_m": found["mu"], "noise.range_sigma_m": found["sigma"]})
    if found["addConstantNoise"]:
        absolute, relative = found["noiseAbsoluteOffset"], found["noiseRelativeOffset"]
        changes.update({"noise.range_offset_m": absolute, "noise.range_offset_percent": relative})
    return {path: value for path, value in changes.items() if value}


@bpy.app.handlers.persistent
def take_over_all(*_: Any) -> None:
    for scene in bpy.data.scenes:
        for sentence in take_over(scene):
            print(f"echocast: {scene.name}: {sentence}")


class EchocastTakeOver(bpy.types.Operator):
    """Use the settings that the BLAINDER range scanner has left in this file"""

    bl_idname = "echocast.take_over"
    bl_label = "Take Over BLAINDER Settings"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> "set[str]":
        told = take_over(context.scene)
        for sentence in told:
            self.report({"INFO"}, sentence)
        if not told:
            self.report({"WARNING"}, "there are no such settings, or the scene has sensors already")
        return {"FINISHED"} if told else {"CANCELLED"}


def register() -> None:
    bpy.utils.register_class(EchocastTakeOver)
    bpy.app.handlers.load_post.append(take_over_all)


def unregister() -> None:
    bpy.app.handlers.load_post.remove(take_over_all)
    bpy.utils.unregister_class(EchocastTakeOver)
