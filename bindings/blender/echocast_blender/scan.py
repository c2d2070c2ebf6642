"""Scans: what is read from Blender for one, the scan itself, which touches nothing of Blender, and its results."""

import contextlib
import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import bpy
import echocast as ec
import numpy as np
from mathutils import Matrix

from . import evaluated, geometry, scene, sensors, settings

#: A scan is sampled this often per frame of the animation, as motion between samples is along straight lines.
SAMPLES_PER_FRAME = 2
#: Most samples of one scan.
MOST_SAMPLES = 240


@dataclass
class Task:
    """A scan with one sensor."""

    name: str
    sensor: ec.Sensor
    frame: int
    options: "dict[str, Any]"


@dataclass
class Result:
    """What a sensor has seen."""

    task: Task
    cloud: ec.PointCloud
    ping: "ec.Ping | None" = None
    #: What deserves attention, such as that no beam meets anything.
    notes: "list[str]" = field(default_factory=list)


@dataclass
class Frame:
    """The scans of one frame."""

    number: int
    live: ec.LiveScene
    tasks: "list[Task]"
    #: Where the sensors are, by name: scale of the scene, m per unit.
    scale: float
    notes: "list[str]" = field(default_factory=list)


@contextlib.contextmanager
def same_frame(timeline: Any) -> "Iterator[None]":
    """Sets a scene back to the frame that it has now."""
    begun, part = timeline.frame_current, timeline.frame_subframe
    try:
        yield
    finally:
        if (timeline.frame_current, timeline.frame_subframe) != (begun, part):
            timeline.frame_set(begun, subframe=part)


def frames(context: Any) -> "list[int]":
    """The frames to scan."""
    wanted, timeline = context.scene.echocast, context.scene
    if wanted.frames == "CURRENT":
        return [timeline.frame_current]
    return list(range(timeline.frame_start, timeline.frame_end + 1, wanted.step))


def frame_rate(timeline: Any) -> float:
    """Frames per second."""
    return timeline.render.fps / timeline.render.fps_base


def read(context: Any) -> scene.ExportedScene:
    """The scene as it is now; ec.Error if there is nothing to scan."""
    exported = scene.exported(context)
    if not exported.seen:
        why = f" ({exported.notes[0]})" if exported.notes else ""
        raise ec.ArgumentError(f"nothing in the scene can be scanned: no visible object has a face{why}; allowed: at least one")
    return exported


def prepare(context: Any, number: int) -> Frame:
    """Reads what the scans of a frame need; ec.Error if that cannot be scanned. Leaves Blender at that frame."""
    timeline = context.scene
    things = sensors.all_of(timeline)
    if not things:
        raise ec.ArgumentError("the scene has no sensor; allowed: at least one enabled (Add Sensor in the tab Echocast of the sidebar)")
    if timeline.frame_current != number or timeline.frame_subframe:
        timeline.frame_set(number)
    wanted, scale = timeline.echocast, timeline.unit_settings.scale_length
    instruments = {thing.name: instrument(thing, wanted) for thing in things}
    exported, rate = read(context), frame_rate(timeline)
    start = number / rate
    paths = {thing.name: [pose(context, thing, scale)] for thing in things}
    times = [start]
    if wanted.motion and is_animated(timeline):
        period = max(one.period for one in instruments.values())
        times = sample(context, exported, paths, number, start, period, rate)
    environment = wanted.environment(scale)
    tasks = []
    for thing in things:
        sensor = instruments[thing.name]
        options = dict(
            at=trajectory(times, paths[thing.name]),
            fields=columns(wanted, sensor),
            seed=wanted.seed,
            frame=max(0, number),
            start_time=start,
            environment=environment,
            profile=wanted.profile,
        )
        tasks.append(Task(thing.name, sensor, number, options))
    return Frame(number, exported.live, tasks, scale, list(dict.fromkeys(exported.notes)))


def instrument(thing: Any, wanted: Any) -> ec.Sensor:
    try:
        sensor = thing.echocast.sensor()
        return sensor if wanted.noise else sensors.without_errors(sensor)
    except ec.Error as error:
        raise ec.ArgumentError(f"sensor {thing.name}: {error}") from error


def columns(wanted: Any, sensor: ec.Sensor) -> str:
    """The columns that are wanted, with those that results need: clouds places, explanations beams, images their layers."""
    needed = ["x", "y", "z", "beam"]
    if wanted.color in settings.COLUMNS:
        needed.append(wanted.color)
    if wanted.images and sensor.kind == "tof":
        needed += ["range", "depth", "category_id"]
    return ",".join([wanted.columns.strip() or "default", *needed])


def pose(context: Any, thing: Any, scale: float) -> Any:
    found = sensors.pose(thing.evaluated_get(context.evaluated_depsgraph_get()), scale)
    if not np.isfinite(found).all():
        raise ec.ArgumentError(f"{thing.name} is at a place that is not of numbers; allowed: finite numbers")
    return found


def trajectory(times: "list[float]", poses: "list[Any]") -> "ec.Pose | ec.Trajectory":
    if all(np.array_equal(one, poses[0]) for one in poses):
        return ec.Pose(poses[0])
    quaternions = [ec.Pose(one).quaternion for one in poses]
    return ec.Trajectory(times, [one[:3, 3] for one in poses], quaternions)


def is_animated(timeline: Any) -> bool:
    """Whether anything may move from frame to frame."""
    animated = any(getattr(thing, "animation_data", None) is not None for thing in timeline.objects)
    data = any(getattr(thing.data, "animation_data", None) is not None for thing in timeline.objects if thing.data)
    moving = any(
        thing.modifiers or thing.particle_systems or thing.constraints or thing.rigid_body or shape_keys(thing)
        for thing in timeline.objects
    )
    return animated or data or moving


def shape_keys(thing: Any) -> bool:
    keys = getattr(thing.data, "shape_keys", None)
    return keys is not None and keys.animation_data is not None


def sample(
    context: Any,
    exported: scene.ExportedScene,
    paths: "dict[str, list[Any]]",
    number: int,
    start: float,
    period: float,
    rate: float,
) -> "list[float]":
    """Evaluates the animation from frame `number` on for `period`, s, and gives what moves its motion; appends the poses
    of the sensors to `paths`. Returns the times."""
    count = min(MOST_SAMPLES, max(1, math.ceil(period * rate * SAMPLES_PER_FRAME - 1e-9)))
    parts = [index / count for index in range(count + 1)]
    times = [start + period * part for part in parts]
    follow(context, exported, paths, [number + period * rate * part for part in parts], times)
    exported.live.set_time(start, period)
    return times


def follow(
    context: Any, exported: scene.ExportedScene, paths: "dict[str, list[Any]]", numbers: "list[float]", times: "list[float]"
) -> None:
    """Gives what moves over the frames `numbers`, at `times`, its motion, and appends poses of objects to `paths`. The
    scene is `exported` as it is at the first of them, where Blender is left."""
    timeline = context.scene
    poses = {key: [np.frombuffer(seen.pose).reshape(4, 4)] for key, seen in exported.seen.items()}
    places: "dict[Any, dict[int, Any]]" = {}
    scale = timeline.unit_settings.scale_length
    try:
        for index, frame in enumerate(numbers[1:], 1):
            timeline.frame_set(math.floor(frame), subframe=frame - math.floor(frame))
            evaluated.visit(context, lambda depsgraph: look(depsgraph, exported, index, poses, places))
            for name, path in paths.items():
                path.append(pose(context, timeline.objects[name], scale))
    finally:
        timeline.frame_set(math.floor(numbers[0]), subframe=numbers[0] - math.floor(numbers[0]))
    for key, path in poses.items():
        seen = exported.seen[key]
        # What has vanished stays where it was.
        path += [path[-1]] * (len(times) - len(path))
        if not all(np.array_equal(one, path[0]) for one in path):
            exported.live.set_motion(seen.number, times, np.stack(path))
            # The next update places it anew.
            seen.pose = b""
    first_places = exported.places(set(places), context) if places else {}
    for key, moved in places.items():
        first = first_places.get(key)
        # What is built of other vertices from frame to frame stays as it is.
        if first is None or any(one.shape != first.shape for one in moved.values()):
            exported.notes.append(f"{exported.name(key)} changes its vertices: within a scan it keeps the shape of the first")
            continue
        frames_ = [first]
        for index in range(1, len(times)):
            frames_.append(moved.get(index, frames_[-1]))
        if not all(np.array_equal(one, first) for one in frames_):
            exported.live.set_vertex_motion(exported.seen[key].number, times, np.stack(frames_))
            exported.deformed.add(key)


def look(depsgraph: Any, exported: scene.ExportedScene, index: int, poses: "dict[Any, list[Any]]", places: Any) -> None:
    """Records poses of all that is seen, and vertices of what has changed its shape."""
    to_metres = scene.to_metres(depsgraph)
    for instance in evaluated.instances(depsgraph):
        key = scene.key_of(instance)
        path = poses.get(key)
        if path is None or len(path) != index:
            continue
        matrix = to_metres @ np.array(instance.matrix_world, dtype=np.float64)
        path.append(matrix if np.isfinite(matrix).all() else path[-1])
        if exported.has_changed(instance):
            found = geometry.vertices(instance.object.data)
            if np.isfinite(found).all():
                places.setdefault(key, {})[index] = found


def run(frame: Frame, progress: "Callable[[float], bool]", images: bool = False) -> "Iterator[Result]":
    """Makes the scans of a frame, and the pings that images of sonars show; ec.CancelledError if `progress` returns False."""
    for index, task in enumerate(frame.tasks):
        told = lambda fraction, index=index: progress((index + fraction) / len(frame.tasks))
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            cloud = frame.live.scan(task.sensor, progress=told, **task.options)
            ping = None
            # A scan pings, too, but gives only the points.
            if images and task.sensor.kind == "sonar" and task.options["profile"] == "physical":
                ping = frame.live.ping(task.sensor, **{**task.options, "fields": None})
        yield Result(task, cloud, ping, [f"{task.name}: {one.message}" for one in warned])
