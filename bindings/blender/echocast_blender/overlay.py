"""Fields of view of sensors in the viewport."""

from typing import Any

import bpy
import echocast as ec
import numpy as np
from mathutils import Matrix

from . import sensors

#: Sectors of azimuth whose lowest and highest beams are drawn.
SECTORS = 72
COLOR, ACTIVE = (0.15, 0.6, 0.75, 0.6), (1.0, 0.62, 0.1, 0.9)

HANDLES: "list[Any]" = []
#: Ends of lines in the axes of the sensor, by pointer of the object and its instrument.
LINES: "dict[int, tuple[ec.Sensor, Any]]" = {}


def outline(sensor: ec.Sensor) -> Any:
    """Pairs of unit vectors, or zero for the sensor itself: lines around what the beams cover, 2n x 3."""
    directions = sensor.directions
    if not len(directions):
        return np.zeros((0, 3), dtype=np.float32)
    azimuth = np.arctan2(directions[:, 1], directions[:, 0])
    sector = np.minimum(((azimuth + np.pi) / (2 * np.pi) * SECTORS).astype(int), SECTORS - 1)
    lines: "list[Any]" = []
    edges: "list[tuple[Any, Any] | None]" = [None] * SECTORS
    for index in range(SECTORS):
        beams = directions[sector == index]
        if len(beams):
            edges[index] = beams[beams[:, 2].argmin()], beams[beams[:, 2].argmax()]
    for index, edge in enumerate(edges):
        if edge is None:
            continue
        following = edges[(index + 1) % SECTORS]
        if following is not None:
            for low_or_high in (0, 1):
                lines += [edge[low_or_high], following[low_or_high]]
        # Spokes every 30 degrees, and where the view ends.
        if index % (SECTORS // 12) == 0 or following is None or edges[index - 1] is None:
            lines += [np.zeros(3), edge[0], np.zeros(3), edge[1], edge[0], edge[1]]
    return np.array(lines, dtype=np.float32)


def lines_of(thing: Any) -> Any:
    sensor = thing.echocast.sensor()
    key = thing.as_pointer()
    if key not in LINES or LINES[key][0] is not sensor:
        LINES[key] = (sensor, outline(sensor))
    return LINES[key][1]


def draw() -> None:
    import gpu
    from gpu_extras.batch import batch_for_shader

    context = bpy.context
    shader = gpu.shader.from_builtin("UNIFORM_COLOR" if bpy.app.version >= (4, 0) else "3D_UNIFORM_COLOR")
    gpu.state.blend_set("ALPHA")
    for thing in sensors.all_of(context.scene):
        own = thing.echocast
        if not own.show_view or not thing.visible_get():
            continue
        try:
            lines = lines_of(thing)
        except ec.Error:
            continue
        place, rotation, _ = thing.matrix_world.decompose()
        matrix = Matrix.LocRotScale(place, rotation, None)
        if thing.type == "CAMERA":
            matrix = matrix @ sensors.CAMERA
        turned = lines * own.view_length @ np.array(matrix.to_3x3()).T + np.array(matrix.translation)
        batch = batch_for_shader(shader, "LINES", {"pos": turned.astype(np.float32).tolist()})
        shader.bind()
        shader.uniform_float("color", ACTIVE if thing == context.object else COLOR)
        batch.draw(shader)
    gpu.state.blend_set("NONE")


def register() -> None:
    if not bpy.app.background:
        HANDLES.append(bpy.types.SpaceView3D.draw_handler_add(draw, (), "WINDOW", "POST_VIEW"))


def unregister() -> None:
    while HANDLES:
        bpy.types.SpaceView3D.draw_handler_remove(HANDLES.pop(), "WINDOW")
    LINES.clear()
