"""Visualisation: pictures in a viewer, recordings for Rerun, plots with matplotlib. Each package is imported when it is
needed."""

import base64
import contextlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from echocast._arrays import check_type
from echocast._convert import package
from echocast._echocast import Box, Ping, Pings, PointCloud, Trajectory, columns
from echocast._errors import ArgumentError, UnsupportedError
from echocast._progress import in_notebook

# Label columns by their name in `color`, and the attribute of a cloud that holds their names.
LABELS = {
    "category": ("category_id", "categories"),
    "part": ("part_id", "parts"),
    "instance": ("instance_id", "instances"),
    "material": ("material_id", "materials"),
}

# Values that `color` may have.
COLORS = f"{', '.join(LABELS)} or the name of a column"

# Rerun has classes of 16 bits.
MOST_CLASSES = 2**16

# Number of poses with which a trajectory is drawn.
POSES = 200

# Most names in a legend.
MOST_NAMES = 16

# For each view of a plot: its axes, the axis along which points hide others, and the sign of that axis from back to front.
VIEWS = {"top": ("xy", "z", 1), "side": ("xz", "y", -1), "3d": ("xyz", None, 1)}


def show(
    thing: Any,
    *,
    path: str | os.PathLike[str] | None = None,
    name: str | None = None,
    time: float | None = None,
    color: str | None = None,
) -> None:
    """Shows a cloud, a trajectory, a ping, pings, or several of them: a list, or a dict by name.

    With rerun-sdk installed they are logged to Rerun: to the active recording, or to a viewer that is opened; with `path`,
    to an .rrd file. Without rerun-sdk, the picture of a cloud or of pings is opened. `name`: the name of the entity in
    Rerun; `time`: time of a cloud in s, by default that of its first point; `color`: "category", "part", "instance",
    "material" or a column.

    Raises UnsupportedError if there is no display, ArgumentError for other things and for a `path` that is no .rrd file,
    ImportError for a `path` without rerun-sdk.

    >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
    >>> cloud = room.scan("velodyne_vlp16", at=room.camera("Scanner"), boxes=True)
    >>> path = ec.Trajectory([0.0, 1.0], np.array([[0.0, 0, 2], [4, 0, 2]]))
    >>> ec.show({"top": cloud, "drive": path}, path="drive.rrd")
    """
    check_type("path", path, (str, os.PathLike), "the name of a recording, which ends in .rrd")
    check_type("name", name, str, "a text")
    check_type("time", time, Real, "a number")
    check_type("color", color, str, COLORS)
    if path is not None:
        package("rerun", "rerun-sdk")
        if Path(path).suffix != ".rrd":
            raise ArgumentError(f"path is {str(path)!r}; allowed: the name of a recording, which ends in .rrd")
    elif importlib.util.find_spec("rerun") is None:
        open_picture(thing, color)
        return
    with recording(path) as stream:
        log(thing, stream, name=name, time=time, color=color)


@contextlib.contextmanager
def recording(path: str | os.PathLike[str] | None) -> Iterator[Any]:
    """A recording of Rerun: to the file `path`, or the active one, or one with a viewer."""
    import rerun as rr

    if path is not None:
        stream = rr.RecordingStream("echocast")
        try:
            stream.save(path)
            yield stream
        finally:
            stream.disconnect()
        return
    if rr.get_data_recording() is None:
        check_display("show(path='cloud.rrd') writes a recording for Rerun")
        rr.init("echocast", spawn=True)
    yield rr.get_data_recording()


def log(
    thing: Any, stream: Any, *, name: str | None = None, time: float | None = None, color: str | None = None
) -> None:
    """Logs what `show` takes to a recording of Rerun."""
    if isinstance(thing, dict):
        for name, one in thing.items():
            log(one, stream, name=name, time=time, color=color)
    elif isinstance(thing, PointCloud):
        log_cloud(thing, stream, name or "cloud", time, color)
    elif isinstance(thing, Trajectory):
        log_trajectory(thing, stream, name or "trajectory")
    elif isinstance(thing, Ping):
        log_ping(thing, stream, name or "pings")
    elif isinstance(thing, (list, tuple, Pings)):
        if not isinstance(thing, Pings) and thing and isinstance(thing[0], Box):
            log_boxes(thing, stream, name or "boxes")
        else:
            for one in thing:
                log(one, stream, name=name, time=time, color=color)
    else:
        allowed = "a PointCloud, a Trajectory, a Ping, Pings, boxes, a list or a dict of them"
        raise ArgumentError(f"the object to show is of the type {type(thing).__name__}; allowed: {allowed}")


def log_cloud(cloud: PointCloud, stream: Any, name: str, time: float | None, color: str | None) -> None:
    """Logs a cloud at its time: `name`/points and, if it has them, `name`/boxes. They are placed in the world, even if
    the cloud is in the sensor frame."""
    import rerun as rr

    seen = np.isfinite(cloud.xyz).all(axis=1)
    if time is None and "time" in cloud.fields and seen.any():
        time = float(cloud["time"][seen].min())
    if time is not None:
        stream.set_time("time", duration=time)
    pose = cloud.sensor_pose
    if cloud.coordinates == "sensor":
        stream.log(name, rr.Transform3D(translation=pose.position, quaternion=pose.quaternion))
    stream.log(f"{name}/points", rr.Transform3D(translation=cloud.origin))
    color = color or default_color(cloud)
    looks: dict[str, Any] = {}
    if color in LABELS:
        column, names = LABELS[color]
        numbers = cloud[column][seen]
        if len(numbers) == 0 or numbers.max() < MOST_CLASSES:
            log_names(getattr(cloud, names), stream, name)
            looks["class_ids"] = numbers.astype(np.uint16)
    elif color is not None:
        looks["colors"] = shades(cloud[color][seen])
    stream.log(f"{name}/points", rr.Points3D(cloud.xyz[seen], radii=rr.Radius.ui_points(1.5), **looks))
    if cloud.boxes is not None:
        log_boxes(cloud.boxes, stream, f"{name}/boxes", classes=color == "category")


def log_names(names: Mapping[int, str], stream: Any, name: str) -> None:
    """Logs the names of the classes below `name`."""
    import rerun as rr

    known = [(number, text) for number, text in names.items() if number < MOST_CLASSES]
    stream.log(name, rr.AnnotationContext(known), static=True)


def log_boxes(boxes: Sequence[Box], stream: Any, name: str, classes: bool = False) -> None:
    """Logs boxes; with `classes`, in the colours of their categories."""
    import rerun as rr

    classes = classes and all(box.category_id < MOST_CLASSES for box in boxes)
    made = rr.Boxes3D(
        centers=[box.center for box in boxes],
        sizes=[box.size for box in boxes],
        quaternions=[rr.Quaternion(xyzw=box.quaternion) for box in boxes],
        labels=[box.name or box.category for box in boxes],
        class_ids=[box.category_id for box in boxes] if classes else None,
        # The names of many boxes would hide them.
        show_labels=False,
    )
    stream.log(name, made)


def log_trajectory(path: Trajectory, stream: Any, name: str) -> None:
    """Logs a trajectory as a line, and as axes that move along it, x red, y green, z blue."""
    import rerun as rr

    first, last = path.span
    times = np.linspace(first, last, POSES if last > first else 1)
    poses = [path.at(time) for time in times]
    if len(poses) > 1:
        stream.log(f"{name}/line", rr.LineStrips3D([[pose.position for pose in poses]]), static=True)
    axes = rr.Arrows3D(vectors=np.eye(3), colors=[[255, 60, 60], [60, 200, 60], [80, 120, 255]])
    stream.log(f"{name}/sensor", axes, static=True)
    for time, pose in zip(times, poses):
        stream.set_time("time", duration=time)
        stream.log(f"{name}/sensor", rr.Transform3D(translation=pose.position, quaternion=pose.quaternion))


def log_ping(ping: Ping, stream: Any, name: str) -> None:
    """Logs a ping at its time: its levels, beams x bins, dB, and the pose of the sonar."""
    import rerun as rr

    stream.set_time("time", duration=ping.time)
    levels = ping.levels
    shades = [ping.noise_db, max(float(levels.max()), ping.noise_db + 1)] if levels.size else None
    stream.log(f"{name}/levels", rr.Tensor(levels, dim_names=["beam", "bin"], value_range=shades))
    stream.log(f"{name}/sonar", rr.Transform3D(translation=ping.pose.position, quaternion=ping.pose.quaternion))


# Most label names in a row of a notebook's table.
FEW_NAMES = 8


def html(cloud: PointCloud) -> str:
    """What a notebook shows for a cloud: its picture, the number of points, and the contents of each column."""
    picture = base64.b64encode(cloud._repr_png_() or b"").decode()
    head = f"<b>{len(cloud):,} points</b>, x, y and z relative to {', '.join(f'{axis:g}' for axis in cloud.origin)} m"
    names = {column: getattr(cloud, names) for column, names in LABELS.values()}
    rows = []
    for name, _, unit, meaning in columns():
        if name in cloud.fields:
            values = cloud[name][np.isfinite(cloud[name])]
            low, high = (f"{values.min():.6g}", f"{values.max():.6g}") if len(values) else ("", "")
            found = [names[name].get(number, str(number)) for number in np.unique(values)] if name in names else []
            told = ", ".join(found[:FEW_NAMES]) + (", …" if len(found) > FEW_NAMES else "") if found else meaning
            cells = [name, "" if unit == "1" else unit, low, high, told]
            rows.append("".join(f"<td>{escape(cell)}</td>" for cell in cells))
    header = "".join(f"<th>{title}</th>" for title in ("column", "unit", "lowest", "highest", "contents"))
    table = "".join(f"<tr>{row}</tr>" for row in [header, *rows])
    image = f'<img src="data:image/png;base64,{picture}"/>' if picture else ""
    return f"<div>{image}<p>{head}</p><table>{table}</table></div>"


def open_picture(thing: Any, color: str | None) -> None:
    """Opens the picture of a cloud or of pings, inside the notebook if there is one."""
    if not isinstance(thing, (PointCloud, Pings)):
        kind = type(thing).__name__
        raise UnsupportedError(f"of a {kind} there is no picture; pip install rerun-sdk to see it in Rerun")
    names = {None: {}, "category": {"color": "label"}}
    png = thing.png(**names.get(color, {"color": color}))
    if in_notebook():
        from IPython.display import Image, display

        display(Image(data=png))
        return
    check_display("png() makes the picture as bytes")
    with tempfile.NamedTemporaryFile(prefix="echocast-", suffix=".png", delete=False) as file:
        file.write(png)
    # The viewer reads it later.
    quiet = subprocess.DEVNULL
    subprocess.Popen([viewer(), file.name], stdin=quiet, stdout=quiet, stderr=quiet)


def viewer() -> str:
    """The program that opens files as the desktop does."""
    return "open" if sys.platform == "darwin" else "xdg-open"


def check_display(instead: str) -> None:
    """Fails where nothing can be shown."""
    if sys.platform != "darwin" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise UnsupportedError(f"there is no display to show it on; {instead}")
    if shutil.which(viewer()) is None:
        raise UnsupportedError(f"there is no program {viewer()} to show it with; {instead}")


def default_color(cloud: PointCloud) -> str | None:
    """The default of `color` for a cloud."""
    wanted = {"category": "category_id", "intensity": "intensity", "range": "range"}
    return next((color for color, column in wanted.items() if column in cloud.fields), None)


def shades(values: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    """Colours from dark blue for the lowest of `values` to light yellow for the highest: n x 3, uint8."""
    values = np.asarray(values, dtype=np.float64)
    known = values[np.isfinite(values)]
    # Percentiles, so that a few bright points do not make all others dark.
    low, high = np.percentile(known, [1, 99]) if len(known) else (0.0, 1.0)
    place = np.clip(np.nan_to_num((values - low) / max(high - low, 1e-12)), 0, 1)
    stops = [0, 0.33, 0.67, 1]
    channels = ([40, 60, 40, 250], [30, 120, 190, 230], [110, 160, 120, 90])
    return np.column_stack([np.interp(place, stops, channel) for channel in channels]).astype(np.uint8)


def plot(cloud: PointCloud, *, color: str | None = None, view: str = "top", ax: Any = None) -> Any:
    """Draws a cloud with matplotlib, in the coordinates of the world or of the sensor, m; returns the axes.

    `color`: "category", "part", "instance", "material" or a column; `view`: "top", "side" (along y) or "3d"; `ax`: axes
    to draw in.
    """
    check_type("color", color, str, COLORS)
    check_type("view", view, str, ", ".join(VIEWS))
    if not (ax is None or hasattr(ax, "scatter") and hasattr(ax, "name")):
        raise TypeError(f"ax is of the type {type(ax).__name__}; allowed: axes of matplotlib")
    if view not in VIEWS:
        raise ArgumentError(f"view is {view!r}; allowed: {', '.join(VIEWS)}")
    package("matplotlib", "matplotlib")
    import matplotlib.pyplot as plt

    axes, behind, sign = VIEWS[view]
    if ax is None:
        figure = plt.figure(figsize=(9, 6), layout="constrained")
        ax = figure.add_subplot(projection="3d" if view == "3d" else None)
    elif (view == "3d") != (ax.name == "3d"):
        raise ArgumentError(f"ax has the projection {ax.name!r}; allowed: '3d' for the view '3d', else a flat one")
    places = {axis: cloud[axis] + cloud.origin["xyz".index(axis)] for axis in "xyz"}
    rows = np.flatnonzero(np.isfinite(cloud.xyz).all(axis=1))
    if behind is not None:
        rows = rows[np.argsort(sign * places[behind][rows], kind="stable")]
    drawn = [places[axis][rows] for axis in axes]
    # So small that points of dense clouds can be distinguished.
    look = {"s": float(np.clip(20_000 / max(len(rows), 1), 0.3, 9)), "linewidths": 0, "rasterized": True}
    color = color or default_color(cloud)
    if color is None:
        ax.scatter(*drawn, **look)
    elif color in LABELS:
        column, names = LABELS[color]
        numbers = cloud[column][rows]
        ax.scatter(*drawn, color=label_colors(plt, numbers), **look)
        if len(rows):
            legend(ax, plt, numbers, getattr(cloud, names))
    else:
        values = cloud[color][rows]
        low, high = np.nanpercentile(values, [1, 99]) if np.isfinite(values).any() else (None, None)
        points = ax.scatter(*drawn, c=values, vmin=low, vmax=high, **look)
        ax.figure.colorbar(points, ax=ax, label=color, shrink=0.6)
    ax.set_aspect("equal")
    ax.set_xlabel(f"{axes[0]} / m")
    ax.set_ylabel(f"{axes[1]} / m")
    if view == "3d":
        ax.set_zlabel("z / m")
    return ax


def label_colors(plt: Any, numbers: npt.NDArray[np.uint32]) -> npt.NDArray[np.float64]:
    """A colour for each of `numbers`, the same in every plot; 0, which is unlabelled, is grey."""
    table = np.array([(0.6, 0.6, 0.6), *plt.colormaps["tab20"].colors])
    return table[np.where(numbers == 0, 0, (numbers - 1) % 20 + 1)]


def legend(ax: Any, plt: Any, numbers: npt.NDArray[np.uint32], names: Mapping[int, str]) -> None:
    """Adds a legend of the most common of `numbers`."""
    found, counts = np.unique(numbers, return_counts=True)
    found = found[np.argsort(-counts, kind="stable")][:MOST_NAMES]
    for number, color in zip(found, label_colors(plt, found)):
        nothing: list[list[float]] = [[]] * (3 if ax.name == "3d" else 2)
        ax.scatter(*nothing, color=[color], s=20, label=names.get(int(number), "unlabelled" if number == 0 else number))
    # Beside the axes; in three dimensions also beside the numbers of the last one.
    left = 1.1 if ax.name == "3d" else 1.02
    ax.legend(loc="center left", bbox_to_anchor=(left, 0.5), frameon=False, fontsize="small")
