"""What the buttons do."""

import contextlib
import json
import queue
import threading
from typing import Any

import bmesh
import bpy
import echocast as ec
import numpy as np

from . import clouds, files, scan, scene, sensors

#: Why nothing else is scanned while a scan runs in a window, which sees the scene as it was read.
BUSY = "a scan is running; allowed: one at a time, once it has ended or Esc has stopped it"


def report(operator: Any, context: Any, notes: "list[str]") -> None:
    """Says what was approximated, each once, and keeps it for the panel."""
    context.scene.echocast.notes = json.dumps(notes)
    for note in notes:
        operator.report({"WARNING"}, note)


def is_object_mode(operator: Any, context: Any) -> bool:
    """Whether Blender is in object mode; says so where it is not."""
    operator.poll_message_set(f"the mode is {context.mode}; allowed: OBJECT")
    return bool(context.mode == "OBJECT")


def is_idle(operator: Any) -> bool:
    """Whether no scan runs in a window; says so where one does."""
    operator.poll_message_set(BUSY)
    return not EchocastScan.running


def finish(context: Any, frame: scan.Frame, results: "list[scan.Result]") -> "list[str]":
    """Puts the results of a frame into files and into the scene; returns sentences about what files do not hold."""
    wanted = context.scene.echocast
    # Files may fail: then the scene is as it was.
    notes = [sentence for result in results for sentence in (*result.notes, *files.write(context, result))]
    for result in results:
        if wanted.clouds:
            clouds.add(context, result, frame.scale)
        if wanted.images:
            clouds.add_images(result)
    return notes


class EchocastScan(bpy.types.Operator):
    """Scan the scene with all enabled sensors"""

    bl_idname = "echocast.scan"
    bl_label = "Scan"
    bl_options = {"REGISTER", "UNDO"}

    #: Whether one runs in a window, and whether undo has gone back behind what it has added.
    running = undone = False

    @classmethod
    def poll(cls, context: Any) -> bool:
        return is_idle(cls) and is_object_mode(cls, context)

    def execute(self, context: Any) -> "set[str]":
        """The whole scan, as in scripts and in the background."""
        notes: "dict[str, None]" = {}
        points, done = 0, 0
        try:
            files.check(context)
            with scan.same_frame(context.scene):
                for number in scan.frames(context):
                    frame = scan.prepare(context, number)
                    results = list(scan.run(frame, lambda fraction: True, context.scene.echocast.images))
                    notes.update(dict.fromkeys([*frame.notes, *finish(context, frame, results)]))
                    points += sum(len(result.cloud) for result in results)
                    done += 1
        except ec.Error as error:
            self.report({"ERROR"}, str(error))
            # What frames before have added is undone with one step.
            return {"FINISHED"} if done else {"CANCELLED"}
        report(self, context, list(notes))
        self.report({"INFO"}, f"{points:,} points")
        return {"FINISHED"}

    # In a window the scan runs in a thread of its own, frame by frame. Meanwhile Blender is the user's: what they change
    # counts from the next frame on.

    def invoke(self, context: Any, _event: Any) -> "set[str]":
        return self.execute(context) if bpy.app.background else self.begin(context)

    def begin(self, context: Any) -> "set[str]":
        try:
            files.check(context)
        except ec.Error as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        # By name: undo gives all data another place in memory.
        self.scene = context.scene.name
        # The frame that there was, and the one that the scan has left Blender at.
        self.begun = self.reached = frame_of(context.scene)
        self.left = scan.frames(context)
        self.total = len(self.left)
        self.points, self.done = 0, 0
        self.notes: "dict[str, None]" = {}
        self.job: "Job | None" = None
        manager = context.window_manager
        self.timer = manager.event_timer_add(0.05, window=context.window)
        manager.progress_begin(0, 1000)
        manager.modal_handler_add(self)
        EchocastScan.running, EchocastScan.undone = True, False
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> "set[str]":
        if event.type == "ESC" and event.value == "PRESS":
            return self.end(context, "stopped: what was scanned before remains")
        if event.type == "TIMER":
            try:
                if self.step(context):
                    return self.end(context, None)
            except ec.Error as error:
                return self.end(context, str(error))
            except BaseException:
                self.cancel(context)
                raise
        return {"PASS_THROUGH"}

    def step(self, context: Any) -> bool:
        """Does what there is to do in Blender; returns whether the scan is complete."""
        if self.scene not in bpy.data.scenes:
            raise ec.ArgumentError(f"the scene {self.scene} is no longer there: what was scanned before remains")
        if self.done and self.undone:
            raise ec.CancelledError("stopped by undo, which takes away what was scanned since the step before")
        EchocastScan.undone = False
        part = (self.done + (self.job.fraction if self.job else 0.0)) / self.total
        context.window_manager.progress_update(int(1000 * part))
        waiting = self.obstacle(context)
        status = f"waiting for {waiting}" if waiting else f"{100 * part:.0f} %"
        context.workspace.status_text_set(f"Echocast: {status}, Esc stops")
        if waiting:
            return False
        if self.job is None:
            try:
                frame = scan.prepare(context, self.left.pop(0))
            finally:
                self.reached = frame_of(context.scene)
            self.job = Job(frame, context.scene.echocast.images)
        elif self.job.is_done():
            job, self.job = self.job, None
            results = job.results()
            self.notes.update(dict.fromkeys([*job.frame.notes, *finish(context, job.frame, results)]))
            self.points += sum(len(result.cloud) for result in results)
            self.done += 1
        return self.done == self.total

    def obstacle(self, context: Any) -> "str | None":
        """What the user does that keeps the scene from being read, and results from being added."""
        if context.scene.name != self.scene:
            return f"the scene {self.scene} to be shown"
        if context.mode != "OBJECT":
            return "object mode"
        return "the end of rendering" if bpy.app.is_job_running("RENDER") else None

    def cancel(self, context: Any) -> None:
        """Ends it without results, as when another file is opened."""
        EchocastScan.running = False
        if self.job is not None:
            self.job.stop()
        context.window_manager.event_timer_remove(self.timer)
        context.window_manager.progress_end()
        if context.workspace is not None:
            context.workspace.status_text_set(None)

    def end(self, context: Any, fault: "str | None") -> "set[str]":
        self.cancel(context)
        timeline = bpy.data.scenes.get(self.scene)
        # A frame that the user has gone to stays.
        if timeline is not None and frame_of(timeline) == self.reached != self.begun:
            timeline.frame_set(self.begun[0], subframe=self.begun[1])
        if fault is not None:
            self.report({"ERROR"}, fault)
            # What frames before have added is undone with one step.
            return {"FINISHED"} if self.done else {"CANCELLED"}
        report(self, context, list(self.notes))
        self.report({"INFO"}, f"{self.points:,} points")
        return {"FINISHED"}


def frame_of(timeline: Any) -> "tuple[int, float]":
    return (timeline.frame_current, timeline.frame_subframe)


class Job:
    """The scans of a frame in a thread, which touches nothing of Blender."""

    def __init__(self, frame: scan.Frame, images: bool) -> None:
        self.frame, self.images, self.fraction = frame, images, 0.0
        self.stopped = False
        self.outcome: "queue.Queue[Any]" = queue.Queue()
        self.thread = threading.Thread(target=self.work, daemon=True)
        self.thread.start()

    def work(self) -> None:
        try:
            self.outcome.put(list(scan.run(self.frame, self.tell, self.images)))
        except BaseException as error:
            self.outcome.put(error)

    def tell(self, fraction: float) -> bool:
        self.fraction = fraction
        return not self.stopped

    def stop(self) -> None:
        self.stopped = True
        self.thread.join()

    def is_done(self) -> bool:
        return not self.thread.is_alive()

    def results(self) -> "list[scan.Result]":
        outcome = self.outcome.get_nowait()
        if isinstance(outcome, BaseException):
            raise outcome
        return outcome


class EchocastAddSensor(bpy.types.Operator):
    """Add an empty that is a sensor, at the 3D cursor"""

    bl_idname = "echocast.add_sensor"
    bl_label = "Echocast Sensor"
    bl_options = {"REGISTER", "UNDO"}

    preset: bpy.props.StringProperty(name="Preset", default="velodyne_vlp16", search=sensors.preset_names)

    @classmethod
    def poll(cls, context: Any) -> bool:
        return is_object_mode(cls, context)

    def execute(self, context: Any) -> "set[str]":
        try:
            title = sensors.instrument(bpy.path.abspath(self.preset), ()).title
        except ec.Error as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        thing = bpy.data.objects.new(title or "Sensor", None)
        thing.empty_display_type, thing.empty_display_size = "ARROWS", 0.3
        # One that is linked from another file cannot hold it.
        collection = context.collection if context.collection.library is None else context.scene.collection
        collection.objects.link(thing)
        thing.location = context.scene.cursor.location
        thing.echocast.is_sensor = True
        thing.echocast.preset = self.preset
        for one in context.selected_objects:
            one.select_set(False)
        with contextlib.suppress(RuntimeError):
            # The collection may be excluded.
            thing.select_set(True)
            context.view_layer.objects.active = thing
        return {"FINISHED"}


class EchocastResetParameters(bpy.types.Operator):
    """Set all parameters of the sensor back to those of its preset"""

    bl_idname = "echocast.reset_parameters"
    bl_label = "Reset Parameters"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        thing = context.object
        return thing is not None and thing.echocast.is_sensor

    def execute(self, context: Any) -> "set[str]":
        context.object.echocast.load_preset()
        return {"FINISHED"}


class EchocastEditList(bpy.types.Operator):
    """Add or remove an item"""

    bl_idname = "echocast.edit_list"
    bl_label = "Edit List"
    bl_options = {"UNDO", "INTERNAL"}

    items: bpy.props.EnumProperty(items=[("outputs", "Outputs", ""), ("layers", "Layers", "")])
    action: bpy.props.EnumProperty(items=[("ADD", "Add", ""), ("REMOVE", "Remove", "")])

    def execute(self, context: Any) -> "set[str]":
        wanted = context.scene.echocast
        items, index = getattr(wanted, self.items), self.items[:-1]
        if self.action == "ADD":
            made = items.add()
            if self.items == "layers" and len(items) > 1:
                made.depth = items[-2].depth + 10.0
            setattr(wanted, index, len(items) - 1)
        elif items:
            items.remove(min(getattr(wanted, index), len(items) - 1))
            setattr(wanted, index, max(0, min(getattr(wanted, index), len(items) - 1)))
        return {"FINISHED"}


class EchocastExplain(bpy.types.Operator):
    """Explain the selected point of a scan, step by step, in a text: how its beam is scanned in the scene as it is now"""

    bl_idname = "echocast.explain"
    bl_label = "Explain Point"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        thing = context.object
        return thing is not None and scene.RESULT in thing and thing.type == "MESH" and is_idle(cls)

    def execute(self, context: Any) -> "set[str]":
        thing = context.object
        try:
            beam = selected_beam(thing)
            made = scene.made_by(thing)
            if "frame" not in made or "sensor" not in made:
                raise ec.ArgumentError("the object does not say what scan it is of; allowed: the result of a scan")
            with scan.same_frame(context.scene):
                frame = scan.prepare(context, made["frame"])
                task = next((task for task in frame.tasks if task.name == made["sensor"]), None)
                if task is None:
                    raise ec.ArgumentError(f"the sensor {made['sensor']} of this scan is not there; allowed: one that is enabled")
                text = frame.live.explain(task.sensor, beam, **task.options)
        except ec.Error as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        title = f"{task.name} {task.frame}, beam {beam}"
        page = bpy.data.texts.get(title) or bpy.data.texts.new(title)
        page.from_string(text)
        for area in context.screen.areas if context.screen else ():
            if area.type == "TEXT_EDITOR":
                area.spaces.active.text = page
        self.report({"INFO"}, f"the text {title} explains it")
        return {"FINISHED"}


def selected_beam(thing: Any) -> int:
    """The beam of the first selected vertex of a cloud."""
    if thing.mode == "EDIT":
        # Attributes are not in the mesh then.
        mesh = bmesh.from_edit_mesh(thing.data)
        layer = mesh.verts.layers.int.get("beam")
        found = (vertex[layer] for vertex in mesh.verts if vertex.select) if layer else None
    else:
        beams = thing.data.attributes.get("beam")
        selected = np.zeros(len(thing.data.vertices), dtype=bool)
        thing.data.vertices.foreach_get("select", selected)
        found = (beams.data[int(index)].value for index in np.flatnonzero(selected)) if beams else None
    if found is None:
        raise ec.ArgumentError("the points have no beams; allowed: those of a scan")
    beam = next(found, None)
    if beam is None:
        raise ec.ArgumentError("no point is selected; allowed: one, in edit mode")
    return int(beam)


CLASSES = (
    EchocastScan,
    EchocastAddSensor,
    EchocastResetParameters,
    EchocastEditList,
    EchocastExplain,
)


@bpy.app.handlers.persistent
def note_undo(*_: Any) -> None:
    EchocastScan.undone = True


def add_menu(menu: Any, _context: Any) -> None:
    menu.layout.operator(EchocastAddSensor.bl_idname, text="Depth Sensor", icon="OUTLINER_OB_LIGHTPROBE")


def register() -> None:
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.VIEW3D_MT_add.append(add_menu)
    bpy.app.handlers.undo_post.append(note_undo)


def unregister() -> None:
    bpy.app.handlers.undo_post.remove(note_undo)
    bpy.types.VIEW3D_MT_add.remove(add_menu)
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
