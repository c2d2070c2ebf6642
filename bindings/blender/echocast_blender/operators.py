"""What the buttons do."""

import json
import queue
import threading
from typing import Any

import bpy
import echocast as ec

from . import clouds, files, scan, scene, sensors


def report(operator: Any, context: Any, notes: "list[str]") -> None:
    """Says what was approximated, each once, and keeps it for the panel."""
    context.scene.echocast.notes = json.dumps(notes)
    for note in notes:
        operator.report({"WARNING"}, note)


def finish(context: Any, frame: scan.Frame, results: "list[scan.Result]") -> "list[str]":
    """Puts the results of a frame into the scene and into files; returns sentences about what files do not hold."""
    wanted = context.scene.echocast
    notes = []
    for result in results:
        if wanted.clouds:
            clouds.add(context, result, frame.scale)
        if wanted.images:
            clouds.add_images(result)
        notes += files.write(context, result)
    LAST.update({(result.task.name, result.task.frame): (frame, result.task) for result in results})
    return notes


#: The scans of this session, by sensor and frame: what explanations repeat.
LAST: "dict[tuple[str, int], tuple[scan.Frame, scan.Task]]" = {}


class EchocastScan(bpy.types.Operator):
    """Scan the scene with all enabled sensors"""

    bl_idname = "echocast.scan"
    bl_label = "Scan"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.mode == "OBJECT" and context.scene is not None

    def execute(self, context: Any) -> "set[str]":
        """The whole scan, as in scripts and in the background."""
        begun = context.scene.frame_current
        notes: "dict[str, None]" = {}
        points = 0
        try:
            for number in scan.frames(context):
                frame = scan.prepare(context, number)
                results = list(scan.run(frame, lambda fraction: True))
                notes.update(dict.fromkeys([*frame.notes, *finish(context, frame, results)]))
                points += sum(len(result.cloud) for result in results)
        except ec.Error as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        finally:
            if context.scene.frame_current != begun:
                context.scene.frame_set(begun)
        report(self, context, list(notes))
        self.report({"INFO"}, f"{points:,} points")
        return {"FINISHED"}

    # In a window the scan runs in a thread of its own, frame by frame.

    def invoke(self, context: Any, _event: Any) -> "set[str]":
        if bpy.app.background:
            return self.execute(context)
        self.begun = context.scene.frame_current
        self.left = scan.frames(context)
        self.total = len(self.left)
        self.points, self.notes = 0, {}
        self.job: "Job | None" = None
        manager = context.window_manager
        self.timer = manager.event_timer_add(0.05, window=context.window)
        manager.progress_begin(0, 1000)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> "set[str]":
        if event.type == "ESC" and event.value == "PRESS":
            if self.job is not None:
                self.job.stop()
            return self.end(context, "stopped: what was scanned before remains")
        if event.type != "TIMER":
            return {"PASS_THROUGH"} if event.type in ("MOUSEMOVE", "INBETWEEN_MOUSEMOVE") else {"RUNNING_MODAL"}
        try:
            if self.job is None:
                if not self.left:
                    return self.end(context, None)
                self.job = Job(scan.prepare(context, self.left.pop(0)))
            done = self.total - len(self.left) - 1 + self.job.fraction
            context.window_manager.progress_update(int(1000 * done / self.total))
            context.workspace.status_text_set(f"Echocast: {100 * done / self.total:.0f} %, Esc stops")
            if self.job.is_done():
                job, self.job = self.job, None
                results = job.results()
                self.notes.update(dict.fromkeys([*job.frame.notes, *finish(context, job.frame, results)]))
                self.points += sum(len(result.cloud) for result in results)
        except ec.Error as error:
            return self.end(context, str(error))
        return {"RUNNING_MODAL"}

    def end(self, context: Any, fault: "str | None") -> "set[str]":
        manager = context.window_manager
        manager.event_timer_remove(self.timer)
        manager.progress_end()
        context.workspace.status_text_set(None)
        if context.scene.frame_current != self.begun:
            context.scene.frame_set(self.begun)
        if fault is not None:
            self.report({"ERROR"}, fault)
            # What frames before have added is undone with one step.
            return {"FINISHED"} if self.points else {"CANCELLED"}
        report(self, context, list(self.notes))
        self.report({"INFO"}, f"{self.points:,} points")
        return {"FINISHED"}


class Job:
    """The scans of a frame in a thread, which touches nothing of Blender."""

    def __init__(self, frame: scan.Frame) -> None:
        self.frame, self.fraction = frame, 0.0
        self.stopped = False
        self.outcome: "queue.Queue[Any]" = queue.Queue()
        self.thread = threading.Thread(target=self.work, daemon=True)
        self.thread.start()

    def work(self) -> None:
        try:
            self.outcome.put(list(scan.run(self.frame, self.tell)))
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
        return context.mode == "OBJECT"

    def execute(self, context: Any) -> "set[str]":
        known = {name: title for name, title, _ in sensors.presets()}
        thing = bpy.data.objects.new(known.get(self.preset, "Sensor"), None)
        thing.empty_display_type, thing.empty_display_size = "ARROWS", 0.3
        context.collection.objects.link(thing)
        thing.location = context.scene.cursor.location
        thing.echocast.is_sensor = True
        thing.echocast.preset = self.preset
        for one in context.selected_objects:
            one.select_set(False)
        thing.select_set(True)
        context.view_layer.objects.active = thing
        if thing.echocast.fault:
            self.report({"ERROR"}, thing.echocast.fault)
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
            items.remove(getattr(wanted, index))
            setattr(wanted, index, max(0, min(getattr(wanted, index), len(items) - 1)))
        return {"FINISHED"}


class EchocastExplain(bpy.types.Operator):
    """Explain the selected point of a scan, step by step, in a text"""

    bl_idname = "echocast.explain"
    bl_label = "Explain Point"

    @classmethod
    def poll(cls, context: Any) -> bool:
        thing = context.object
        return thing is not None and scene.RESULT in thing and thing.type == "MESH"

    def execute(self, context: Any) -> "set[str]":
        thing = context.object
        if thing.mode == "EDIT":
            thing.update_from_editmode()
        made = json.loads(thing[scene.RESULT])
        point = selected_point(thing)
        if point is None:
            self.report({"ERROR"}, "no point is selected; allowed: one, in edit mode")
            return {"CANCELLED"}
        known = LAST.get((made["sensor"], made["frame"]))
        beams = thing.data.attributes.get("beam")
        if known is None or beams is None:
            self.report({"ERROR"}, "this scan is not of this session of Blender: scan again, then explain")
            return {"CANCELLED"}
        frame, task = known
        beam = beams.data[point].value
        try:
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


def selected_point(thing: Any) -> "int | None":
    """The first selected vertex of a cloud."""
    return next((vertex.index for vertex in thing.data.vertices if vertex.select), None)


CLASSES = (
    EchocastScan,
    EchocastAddSensor,
    EchocastResetParameters,
    EchocastEditList,
    EchocastExplain,
)


def add_menu(menu: Any, _context: Any) -> None:
    menu.layout.operator(EchocastAddSensor.bl_idname, text="Depth Sensor", icon="OUTLINER_OB_LIGHTPROBE")


def register() -> None:
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.VIEW3D_MT_add.append(add_menu)


def unregister() -> None:
    bpy.types.VIEW3D_MT_add.remove(add_menu)
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
    LAST.clear()
