"""What is drawn in the viewport: fields of view of sensors, points of scans, and what their colours mean."""

from typing import Any

import bpy
import echocast as ec
import numpy as np
from mathutils import Matrix, Vector

from . import clouds, scene, sensors, srgb

#: Sectors of azimuth whose lowest and highest beams are drawn.
SECTORS = 72
#: Most beams that are drawn one by one.
FEW = 16
#: Up to this angle from the axis of a field of view an outline is drawn around it.
WIDEST = np.radians(80)
COLOR, ACTIVE, RANGE = (0.15, 0.6, 0.75, 0.6), (1.0, 0.62, 0.1, 0.9), (1.0, 0.62, 0.1, 0.25)
#: Pixels.
POINT_SIZE, ROW, MARGIN = 4, 18, 20
#: Points are drawn this part of their distance closer to the eye: errors of ranges put half of them below surfaces.
CLOSER = 0.003
#: Most rows of the legend.
ROWS = 12

#: A colour as it is shown, and what it means.
Row = tuple[tuple[float, ...], str]

DRAWN: "list[Any]" = []
#: Sensors, and what is drawn of them: ends of lines around what the beams cover, and of lines from the sensor, by pointers
#: of their objects.
VIEWS: "dict[int, tuple[ec.Sensor, Any, Any]]" = {}
#: Points in their colours, and rows of the legend, by pointers of objects.
POINTS: "dict[int, tuple[Any, list[Row]]]" = {}


# --- fields of view ---------------------------------------------------------------------------------------------------


def outline(directions: Any) -> "tuple[Any, Any]":
    """Ends of lines around `directions`, on the unit sphere, and of those from its centre: each 2n x 3, float32."""
    around: "list[Any]" = []
    spokes = list(directions)
    if len(directions) > FEW:
        axis = directions.mean(axis=0)
        axis /= max(np.linalg.norm(axis), 1e-9)
        cone = np.arccos(np.clip(directions @ axis, -1, 1)).max() < WIDEST
        around, spokes = around_cone(directions, axis) if cone else around_turn(directions)
    from_centre = [end for spoke in spokes for end in (np.zeros(3), spoke)]
    first, second = (np.array(lines, dtype=np.float32).reshape(-1, 3) for lines in (around, from_centre))
    return first, second


def around_cone(directions: Any, axis: Any) -> "tuple[list[Any], list[Any]]":
    """The outline of directions that lie less than a right angle from an axis."""
    side = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    side /= np.linalg.norm(side)
    # In the plane at right angles to the axis arcs of the sphere are straight.
    flat = np.stack([directions @ side, directions @ np.cross(axis, side)], axis=1) / (directions @ axis)[:, None]
    # The farthest of each degree: more than enough for the hull.
    farthest = [far for _, far in ends(np.arctan2(flat[:, 1], flat[:, 0]), np.linalg.norm(flat, axis=1), 360).values()]
    corners = directions[farthest][hull(flat[farthest])]
    lines = []
    for one, other in zip(corners, np.roll(corners, -1, axis=0)):
        count = 1 + int(np.linalg.norm(other - one) / 0.1)
        steps = np.linspace(one, other, count + 1)
        steps /= np.linalg.norm(steps, axis=1)[:, None]
        lines += [end for pair in zip(steps[:-1], steps[1:]) for end in pair]
    # Of an outline of many corners, eight.
    return lines, list(corners[:: -(-len(corners) // 8)])


def ends(angle: Any, value: Any, sectors: int) -> "dict[int, tuple[int, int]]":
    """For each sector of an angle that has any: the indices of its least and of its greatest value."""
    sector = ((angle + np.pi) / (2 * np.pi) * sectors).astype(int) % sectors
    order = np.lexsort((value, sector))
    first = np.flatnonzero(np.diff(sector[order], prepend=-1))
    last = np.append(first[1:], len(order)) - 1
    return {int(sector[order[start]]): (int(order[start]), int(order[end])) for start, end in zip(first, last)}


def hull(places: Any) -> "list[int]":
    """The corners of the convex hull of points in a plane, around it (Andrew's monotone chain)."""
    order = np.lexsort((places[:, 1], places[:, 0]))

    def chain(indices: Any) -> "list[int]":
        found: "list[int]" = []
        for index in indices:
            while len(found) > 1:
                along, on = places[found[-1]] - places[found[-2]], places[index] - places[found[-2]]
                if along[0] * on[1] - along[1] * on[0] > 1e-6:
                    break
                found.pop()
            found.append(int(index))
        return found[:-1]

    return chain(order) + chain(order[::-1])


def around_turn(directions: Any) -> "tuple[list[Any], list[Any]]":
    """The lowest and the highest beams of a sensor that looks around."""
    found = ends(np.arctan2(directions[:, 1], directions[:, 0]), directions[:, 2], SECTORS)
    edges = {sector: [directions[end] for end in pair] for sector, pair in found.items()}
    lines: "list[Any]" = []
    spokes: "list[Any]" = []
    for sector, edge in edges.items():
        following = edges.get((sector + 1) % SECTORS)
        if following is not None:
            lines += [edge[0], following[0], edge[1], following[1]]
        # Every 30 degrees, and where the view ends.
        if sector % (SECTORS // 12) == 0 or following is None or (sector - 1) % SECTORS not in edges:
            lines += edge
            flat = abs(edge[1][2] - edge[0][2]) < 1e-3
            spokes += edge[:1] if flat else edge
    return lines, spokes


def draw_view(thing: Any, scale: float, active: bool) -> None:
    """`scale`: metres per unit."""
    import gpu

    try:
        sensor = thing.echocast.sensor()
    except ec.Error:
        return
    key = thing.as_pointer()
    if key not in VIEWS or VIEWS[key][0] is not sensor:
        around, spokes = outline(sensor.directions)
        VIEWS[key] = sensor, batch("LINES", around), batch("LINES", np.concatenate([around, spokes]))
    _, around, lines = VIEWS[key]
    place, rotation, _ = thing.matrix_world.decompose()
    matrix = Matrix.LocRotScale(place, rotation, None)
    if thing.type == "CAMERA":
        matrix = matrix @ sensors.CAMERA
    draw_lines(lines, matrix @ Matrix.Scale(thing.echocast.view_length, 4), ACTIVE if active else COLOR)
    farthest = sensor["range.max_m"]
    if active and np.isfinite(farthest):
        gpu.state.depth_test_set("LESS_EQUAL")
        draw_lines(around, matrix @ Matrix.Scale(farthest / scale, 4), RANGE)
        gpu.state.depth_test_set("NONE")


def draw_lines(lines: Any, matrix: Any, color: "tuple[float, ...]") -> None:
    import gpu

    if lines is None:
        return
    shader = shader_of("UNIFORM_COLOR")
    shader.bind()
    shader.uniform_float("color", color)
    with gpu.matrix.push_pop():
        gpu.matrix.multiply_matrix(matrix)
        lines.draw(shader)


# --- points -----------------------------------------------------------------------------------------------------------


def points_of(thing: Any) -> "tuple[Any, list[Row]]":
    """The points of a cloud, and what their colours mean."""
    key = thing.as_pointer()
    if key not in POINTS:
        mesh = thing.data
        count = len(mesh.vertices)
        places, colors = np.empty(3 * count, dtype=np.float32), np.ones(4 * count, dtype=np.float32)
        mesh.vertices.foreach_get("co", places)
        attribute = mesh.attributes.get(clouds.COLOR)
        if attribute is not None:
            attribute.data.foreach_get("color", colors)
        POINTS[key] = batch("POINTS", places.reshape(-1, 3), encoded(colors.reshape(-1, 4))), legend(thing)
    return POINTS[key]


def draw_points(thing: Any, view: Any) -> None:
    import gpu

    points, _ = points_of(thing)
    if points is None:
        return
    # Later versions have one for points larger than a pixel.
    shader = shader_of("POINT_FLAT_COLOR" if bpy.app.version >= (4, 5) else "FLAT_COLOR")
    gpu.state.point_size_set(POINT_SIZE)
    with gpu.matrix.push_pop():
        if view.is_perspective:
            eye = view.view_matrix.inverted().translation
            gpu.matrix.translate(eye * CLOSER)
            gpu.matrix.scale_uniform(1 - CLOSER)
        else:
            gpu.matrix.translate(view.view_rotation @ Vector((0, 0, view.view_distance * CLOSER)))
        gpu.matrix.multiply_matrix(thing.matrix_world)
        points.draw(shader)


def encoded(colors: Any) -> Any:
    """Linear colours as the shaders take them, sRGB."""
    shown = np.clip(colors, 0, 1)
    shown[:, :3] = srgb.encoded(shown[:, :3])
    return shown


def legend(thing: Any) -> "list[Row]":
    """Colours of a cloud, and what they mean: names, those of most points first, or values."""
    column = scene.made_by(thing).get("color", "")
    values = clouds.column(thing.data, column)
    if values is None or not len(values):
        return []
    if column in clouds.LABELS:
        numbers, counts = np.unique(values, return_counts=True)
        names = thing.get(TABLES.get(column, ""), {})
        order = [int(number) for number in numbers[np.argsort(-counts, kind="stable")]]
        shown = np.array([clouds.label_color(number) for number in order], dtype=np.float32)
        return [(tuple(color), names.get(str(number), str(number))) for color, number in zip(encoded(shown), order)]
    # As clouds.colors spreads them.
    known = values[np.isfinite(values)]
    if not len(known):
        return []
    low, high = np.percentile(known, [1, 99])
    rows: "list[Row]" = []
    for share in (1.0, 0.75, 0.5, 0.25, 0.0) if high > low else (0.0,):
        color = [np.interp(share, clouds.SCALE[:, 0], clouds.SCALE[:, channel]) for channel in (1, 2, 3)]
        title = "" if rows else f"{column.replace('_', ' ')} "
        rows.append((tuple(encoded(np.array([[*color, 1.0]]))[0]), f"{title}{low + share * (high - low):.3g}"))
    return rows


#: Where the names of the numbers of a column are.
TABLES = {
    "category_id": "categories",
    "first_category_id": "categories",
    "part_id": "parts",
    "instance_id": "instances",
    "first_instance_id": "instances",
    "material_id": "materials",
}


# --- drawing ----------------------------------------------------------------------------------------------------------


def batch(kind: str, places: Any, colors: Any = None) -> Any:
    """Points, lines or triangles to draw; None: there are none, which Blender does not take."""
    from gpu_extras.batch import batch_for_shader

    if not len(places):
        return None
    values = {"pos": places} if colors is None else {"pos": places, "color": colors}
    return batch_for_shader(shader_of("UNIFORM_COLOR" if colors is None else "FLAT_COLOR"), kind, values)


def shader_of(name: str) -> Any:
    import gpu

    return gpu.shader.from_builtin(name if bpy.app.version >= (4, 0) else f"3D_{name}")


def shown(context: Any) -> "list[Any]":
    """Objects that the viewport shows."""
    space = context.space_data
    if not space.overlay.show_overlays:
        return []
    return [thing for thing in context.scene.objects if thing.visible_in_viewport_get(space)]


def shown_clouds(context: Any) -> "list[Any]":
    return [one for one in shown(context) if one.type == "MESH" and one.mode == "OBJECT" and scene.made_by(one)]


def draw() -> None:
    """In the space of the scene."""
    import gpu

    context = bpy.context
    gpu.state.depth_test_set("LESS_EQUAL")
    for thing in shown_clouds(context):
        draw_points(thing, context.region_data)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("ALPHA")
    scale = context.scene.unit_settings.scale_length
    for thing in shown(context):
        own = thing.echocast
        if own.is_sensor and own.enabled and own.show_view:
            draw_view(thing, scale, thing == context.object)
    gpu.state.blend_set("NONE")


def draw_legend() -> None:
    """In pixels of the viewport."""
    import blf

    context = bpy.context
    rows = list(dict.fromkeys(row for thing in shown_clouds(context) for row in points_of(thing)[1]))
    if len(rows) > ROWS:
        rows[ROWS - 1 :] = [((0.0, 0.0, 0.0, 0.0), f"and {len(rows) - ROWS + 1} more")]
    unit = context.preferences.system.ui_scale
    # Beside the tools, which the viewport lies under.
    left = sum(region.width for region in context.area.regions if region.type == "TOOLS") + MARGIN * unit
    for index, (color, text) in enumerate(reversed(rows)):
        bottom = (MARGIN + index * ROW) * unit
        side = 10 * unit
        corners = [(left, bottom), (left + side, bottom), (left + side, bottom + side), (left, bottom + side)]
        square = [(*corners[corner], 0.0) for corner in (0, 1, 2, 0, 2, 3)]
        shader = shader_of("UNIFORM_COLOR")
        shader.bind()
        shader.uniform_float("color", color)
        batch("TRIS", square).draw(shader)
        blf.size(0, 12 * unit)
        blf.color(0, 1, 1, 1, 0.9)
        blf.position(0, left + 1.6 * side, bottom, 0)
        blf.draw(0, text)


@bpy.app.handlers.persistent
def forget(_scene: Any, depsgraph: Any = None) -> None:
    """Points that have changed are read again."""
    if not isinstance(depsgraph, bpy.types.Depsgraph):
        POINTS.clear()
        return
    for update in depsgraph.updates:
        if update.is_updated_geometry:
            POINTS.pop(update.id.original.as_pointer(), None)


EVENTS = ("depsgraph_update_post", "undo_post", "redo_post", "load_post")


def register() -> None:
    if bpy.app.background:
        return
    for work, kind in ((draw, "POST_VIEW"), (draw_legend, "POST_PIXEL")):
        DRAWN.append(bpy.types.SpaceView3D.draw_handler_add(work, (), "WINDOW", kind))
    for name in EVENTS:
        getattr(bpy.app.handlers, name).append(forget)


def unregister() -> None:
    if bpy.app.background:
        return
    while DRAWN:
        bpy.types.SpaceView3D.draw_handler_remove(DRAWN.pop(), "WINDOW")
    for name in EVENTS:
        getattr(bpy.app.handlers, name).remove(forget)
    VIEWS.clear()
    POINTS.clear()
