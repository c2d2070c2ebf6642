"""The scene as Blender evaluates it for rendering: what renders is scanned."""

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

import bpy
import echocast as ec

#: Settings of data that differ between viewport and rendering, by type of object: pairs of names.
DATA_PAIRS = {"META": [("resolution", "render_resolution")], "CURVE": [("resolution_u", "render_resolution_u")]}
DATA_PAIRS["FONT"] = DATA_PAIRS["SURFACE"] = DATA_PAIRS["CURVE"]

#: Types of objects that render, and what of them Blender makes no mesh of.
RENDERED = {"MESH": "hairs", "CURVES": "curves", "POINTCLOUD": "points", "VOLUME": "volumes"}
RENDERED["GPENCIL"] = RENDERED["GREASEPENCIL"] = "strokes"


def differs(scene: Any, view_layer: Any) -> bool:
    """Whether rendering sees anything that the viewport does not show, or in another shape."""
    if scene_differs(scene) or any(layer_differs(layer) for layer in view_layer.layer_collection.children):
        return True
    return any(object_differs(thing) for thing in scene.objects if not thing.hide_render)


def scene_differs(scene: Any) -> bool:
    """Whether there are settings that affect any object."""
    trees = (tree for tree in bpy.data.node_groups if tree.type == "GEOMETRY")
    return scene.render.use_simplify or any(node.type == "IS_VIEWPORT" for tree in trees for node in tree.nodes)


def layer_differs(layer: Any) -> bool:
    if layer.exclude or layer.collection.hide_render:
        return False
    hidden = layer.hide_viewport or layer.collection.hide_viewport
    return hidden or any(layer_differs(child) for child in layer.children)


def object_differs(thing: Any) -> bool:
    try:
        hidden = thing.hide_viewport or thing.hide_get()
    except RuntimeError:
        # It is in a collection that is excluded.
        return False
    if hidden:
        return True
    for modifier in thing.modifiers:
        if modifier.show_viewport != modifier.show_render:
            return True
        if modifier.show_render and modifier.type in ("SUBSURF", "MULTIRES") and modifier.levels != modifier.render_levels:
            return True
    for system in thing.particle_systems:
        settings = system.settings
        children = settings.child_type != "NONE" and settings.child_nbr != settings.rendered_child_count
        if settings.display_percentage != 100 or children or settings.display_step != settings.render_step:
            return True
    for shown, rendered in DATA_PAIRS.get(thing.type, ()):
        # A resolution of 0 for rendering is that of the viewport.
        if getattr(thing.data, rendered, 0) not in (0, getattr(thing.data, shown, 0)):
            return True
    return False


class EchocastRenderEngine(bpy.types.RenderEngine):
    """Reads the scene as it is evaluated for rendering; it renders nothing."""

    bl_idname = "ECHOCAST_READ"
    bl_label = "Echocast (reading)"
    bl_use_preview = False
    #: What is done with the depsgraph.
    work: "Callable[[Any], None] | None" = None
    failure: "Exception | None" = None

    def render(self, depsgraph: Any) -> None:
        engine = EchocastRenderEngine
        # Once, even if there are several views.
        work, engine.work = engine.work, None
        if work is not None:
            try:
                work(depsgraph)
            except Exception as error:  # Blender would only print it.
                engine.failure = error


def visit(context: Any, work: "Callable[[Any], None]") -> None:
    """Calls `work` with a depsgraph that is evaluated as for rendering."""
    scene, view_layer = context.scene, context.view_layer
    if not differs(scene, view_layer):
        work(context.evaluated_depsgraph_get())
        return
    engine = EchocastRenderEngine
    engine.work, engine.failure = work, None
    try:
        with changed(view_layer, use=True), changed(scene.render, **READING), any_camera(scene), render_result_kept():
            bpy.ops.render.render(layer=view_layer.name, scene=scene.name)
    except RuntimeError as error:
        raise ec.ArgumentError(f"Blender cannot evaluate the scene for rendering: {str(error).strip()}") from error
    finally:
        done, engine.work = engine.work is None, None
    if engine.failure is not None:
        raise engine.failure
    if not done:
        raise ec.ArgumentError("Blender does not render the scene, and what only rendering shows cannot be read")


#: Settings of rendering while the scene is read.
READING = {
    "engine": EchocastRenderEngine.bl_idname,
    "use_compositing": False,
    "use_sequencer": False,
    "use_border": False,
    "use_multiview": False,
}


@contextlib.contextmanager
def changed(thing: Any, **values: Any) -> "Iterator[None]":
    """Sets properties, and back."""
    kept = {name: getattr(thing, name) for name in values}
    try:
        for name, value in values.items():
            setattr(thing, name, value)
        yield
    finally:
        for name, value in kept.items():
            setattr(thing, name, value)


@contextlib.contextmanager
def any_camera(scene: Any) -> "Iterator[None]":
    """Gives the scene a camera if it has none, as rendering needs one."""
    if scene.camera is not None:
        yield
        return
    data = bpy.data.cameras.new("echocast")
    made = bpy.data.objects.new("echocast", data)
    scene.collection.objects.link(made)
    try:
        with changed(scene, camera=made):
            yield
    finally:
        bpy.data.objects.remove(made)
        bpy.data.cameras.remove(data)


@contextlib.contextmanager
def render_result_kept() -> "Iterator[None]":
    """Keeps the picture that was rendered last: another slot is rendered to. Without one there is none afterwards."""
    result = next((image for image in bpy.data.images if image.type == "RENDER_RESULT"), None)
    if result is not None:
        shown, last = result.render_slots.active_index, len(result.render_slots) - 1
        with changed(result.render_slots, active_index=last if shown != last else 0):
            yield
        return
    try:
        yield
    finally:
        for image in [image for image in bpy.data.images if image.type == "RENDER_RESULT"]:
            image.user_clear()
            bpy.data.images.remove(image)


def instances(depsgraph: Any) -> "Iterator[Any]":
    """Instances of what renders and has a mesh, or something that Blender makes none of, such as the hair of an emitter that
    does not show itself. Each is valid only until the next."""
    rendered = depsgraph.mode == "RENDER"
    shown: "dict[int, bool]" = {}
    layers = {} if rendered else collections_shown(depsgraph.view_layer)
    for instance in depsgraph.object_instances:
        thing = instance.object
        if thing.type not in RENDERED or not (instance.show_self or instance.show_particles):
            continue
        source = instance.parent if instance.is_instance and instance.parent else thing
        if not rendered:
            for one in (thing, source):
                original = one.original
                key = original.as_pointer()
                if key not in shown:
                    shown[key] = not original.hide_render
                if not shown[key]:
                    break
            else:
                if not in_shown_collection(source.original, layers):
                    continue
                yield instance
            continue
        yield instance


def without_mesh(thing: Any) -> "str | None":
    """What of an evaluated object renders, though Blender makes no mesh of it."""
    what = RENDERED[thing.type]
    if thing.type == "MESH":
        systems = (one.particle_system for one in thing.modifiers if one.type == "PARTICLE_SYSTEM" and one.show_render)
        held = [one for one in systems if one.settings.type == "HAIR" and one.settings.render_type == "PATH"]
    else:
        # Where these can be counted, there may be none: nodes have made a mesh of them.
        held = getattr(thing.data, what, [thing])
    return what if len(held) else None


def collections_shown(view_layer: Any) -> "dict[str, bool]":
    """Whether the collections of a view layer render, by name."""
    shown: "dict[str, bool]" = {}

    def add(layer: Any, above: bool) -> None:
        renders = above and not layer.collection.hide_render and not layer.exclude
        name = layer.collection.name
        shown[name] = shown.get(name, False) or renders
        for child in layer.children:
            add(child, renders)

    add(view_layer.layer_collection, True)
    return shown


def in_shown_collection(thing: Any, layers: "dict[str, bool]") -> bool:
    """Whether one of the collections of an object renders."""
    return all(layers.values()) or any(layers.get(one.name, False) for one in thing.users_collection)
