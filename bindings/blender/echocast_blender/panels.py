"""Panels in the sidebar of the 3D viewport, and the list of what was approximated."""

import json
import textwrap
from typing import Any

import bpy

from . import operators, paper, scene, sensors

#: Most sentences about the last scan.
MOST_NOTES = 8


class Panel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Echocast"


class ECHOCAST_PT_scan(Panel, bpy.types.Panel):
    bl_label = "Scan"

    def draw(self, context: Any) -> None:
        layout, wanted = self.layout, context.scene.echocast
        layout.use_property_split, layout.use_property_decorate = True, False
        row = layout.row()
        row.scale_y = 1.5
        row.operator(operators.EchocastScan.bl_idname, icon="OUTLINER_OB_POINTCLOUD")
        found = sensors.all_of(context.scene, only_enabled=False)
        if not found:
            layout.label(text="The scene has no sensor", icon="INFO")
            if paper.stored(context.scene, paper.GROUP) is not None:
                layout.operator(paper.EchocastTakeOver.bl_idname, text="Take Over Settings")
        listed = layout.column(align=True)
        listed.use_property_split = False
        for thing in found:
            line = listed.row(align=True)
            line.prop(thing.echocast, "enabled", text="")
            icon = "ERROR" if thing.echocast.fault else "OUTLINER_OB_LIGHTPROBE"
            line.operator(EchocastSelect.bl_idname, text=thing.name, icon=icon, depress=thing == context.object).name = thing.name
        layout.operator(operators.EchocastAddSensor.bl_idname, text="Add Sensor", icon="ADD")
        layout.prop(wanted, "frames")
        if wanted.frames == "RANGE":
            layout.prop(wanted, "step")
        for name in ("motion", "noise"):
            switch(layout, wanted, name)
        for name in ("seed", "profile"):
            layout.prop(wanted, name)


class ECHOCAST_PT_sensor(Panel, bpy.types.Panel):
    bl_label = "Sensor"

    @classmethod
    def poll(cls, context: Any) -> bool:
        thing = context.object
        return thing is not None and (thing.type in ("EMPTY", "CAMERA") or thing.echocast.is_sensor)

    def draw_header(self, context: Any) -> None:
        self.layout.prop(context.object.echocast, "is_sensor", text="")

    def draw(self, context: Any) -> None:
        layout, own = self.layout, context.object.echocast
        layout.use_property_split, layout.use_property_decorate = True, False
        if not own.is_sensor:
            sentence(layout, context, f"Tick the box above to scan from {context.object.name}", "INFO")
            return
        layout.prop(own, "preset", text="", icon="VIEWZOOM")
        if own.fault:
            sentence(layout, context, own.fault, "ERROR")
        switch(layout, own, "show_view")
        if own.show_view:
            layout.prop(own, "view_length")
        if not own.parameters:
            return
        changed = sum(one.is_changed() for one in own.parameters)
        if changed:
            row = layout.row()
            row.label(text=f"{changed} parameters changed" if changed > 1 else "1 parameter changed")
            row.operator(operators.EchocastResetParameters.bl_idname, text="", icon="LOOP_BACK")
        for section in own.sections():
            self.draw_section(section, own)

    def draw_section(self, section: str, own: Any) -> None:
        box = self.layout.column(align=True)
        shown = own.section == section
        title = box.row()
        title.alignment = "LEFT"
        icon = "DISCLOSURE_TRI_DOWN" if shown else "DISCLOSURE_TRI_RIGHT"
        button = title.operator(EchocastShowSection.bl_idname, text=readable(section).title(), emboss=False, icon=icon)
        button.section = "" if shown else section
        if not shown:
            return
        box.use_property_split = False
        group: "list[str]" = []
        for one in own.parameters:
            *path, key = one.name.split(".")
            if one.name.split(".")[0] != section:
                continue
            if path[1:] != group:
                group = path[1:]
                box.separator(factor=0.5)
                if group:
                    box.label(text=readable(" ".join(group)).capitalize())
            line = box.split(factor=0.5, align=True)
            line.alert = one.is_changed()
            line.label(text=readable(key))
            line.prop(one, one.field(), text="")


class EchocastShowSection(bpy.types.Operator):
    """Show or hide the parameters of a section"""

    bl_idname = "echocast.show_section"
    bl_label = "Show Section"
    bl_options = {"INTERNAL"}

    section: bpy.props.StringProperty()

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.object is not None

    def execute(self, context: Any) -> "set[str]":
        context.object.echocast.section = self.section
        return {"FINISHED"}


class EchocastSelect(bpy.types.Operator):
    """Select this sensor"""

    bl_idname = "echocast.select"
    bl_label = "Select Sensor"
    bl_options = {"UNDO", "INTERNAL"}

    name: bpy.props.StringProperty()

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.mode == "OBJECT"

    def execute(self, context: Any) -> "set[str]":
        thing = context.view_layer.objects.get(self.name)
        if thing is None:
            self.report({"WARNING"}, f"{self.name} is in a collection that is excluded")
            return {"CANCELLED"}
        for one in context.selected_objects:
            one.select_set(False)
        thing.select_set(True)
        context.view_layer.objects.active = thing
        return {"FINISHED"}


class ECHOCAST_PT_medium(Panel, bpy.types.Panel):
    bl_label = "Weather and Water"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        layout, wanted = self.layout, context.scene.echocast
        layout.use_property_split, layout.use_property_decorate = True, False
        # Short labels: there is no room for more, and their units matter.
        for name, details, label in (
            ("fog", "visibility", "Visibility, m"),
            ("rain", "rain_rate", "Rate, mm/h"),
            ("snow", "snow_rate", "Rate, mm/h"),
        ):
            switch(layout, wanted, name)
            if getattr(wanted, name):
                layout.prop(wanted, details, text=label)
        switch(layout, wanted, "water")
        if wanted.water:
            layout.prop(wanted, "surface")
            if not wanted.layers:
                layout.prop(wanted, "temperature", text="Water, °C")
                layout.prop(wanted, "salinity", text="Salt, PSU")
            layout.label(text="Layers")
            row = layout.row()
            row.template_list("ECHOCAST_UL_layers", "", wanted, "layers", wanted, "layer", rows=3)
            edit_buttons(row, "layers")
            if wanted.layers:
                layer = wanted.layers[min(wanted.layer, len(wanted.layers) - 1)]
                for name, label in (("depth", "Depth, m"), ("speed", "Sound, m/s"), ("density", "kg/m³")):
                    layout.prop(layer, name, text=label)
        layout.prop(wanted, "keys")


class ECHOCAST_PT_results(Panel, bpy.types.Panel):
    bl_label = "Results"

    def draw(self, context: Any) -> None:
        layout, wanted = self.layout, context.scene.echocast
        layout.use_property_split, layout.use_property_decorate = True, False
        for name in ("clouds", "images"):
            switch(layout, wanted, name)
        layout.prop(wanted, "color")
        layout.prop(wanted, "radius", text="Radius")
        layout.prop(wanted, "columns")
        layout.label(text="Files")
        row = layout.row()
        row.use_property_split = False
        row.template_list("ECHOCAST_UL_outputs", "", wanted, "outputs", wanted, "output", rows=2)
        edit_buttons(row, "outputs")
        if wanted.outputs:
            output = wanted.outputs[min(wanted.output, len(wanted.outputs) - 1)]
            layout.prop(output, "format")
            layout.prop(output, "path")
        thing = context.object
        if thing is not None and scene.RESULT in thing:
            layout.operator(operators.EchocastExplain.bl_idname, icon="QUESTION")
        notes = json.loads(wanted.notes or "[]")
        for note in notes[:MOST_NOTES]:
            sentence(layout, context, note, "INFO")
        if len(notes) > MOST_NOTES:
            layout.label(text=f"and {len(notes) - MOST_NOTES} more, in the Info editor")


class ECHOCAST_UL_outputs(bpy.types.UIList):
    def draw_item(self, _context: Any, layout: Any, _data: Any, item: Any, _icon: Any, _active: Any, _name: Any) -> None:
        layout.prop(item, "enabled", text="")
        layout.label(text=f"{item.format.upper()}  {item.path}")


class ECHOCAST_UL_layers(bpy.types.UIList):
    def draw_item(self, _context: Any, layout: Any, _data: Any, item: Any, _icon: Any, _active: Any, _name: Any) -> None:
        layout.label(text=f"{item.depth:g} m: {item.speed:g} m/s")


def switch(layout: Any, data: Any, name: str) -> None:
    """A box to tick, over the whole width: beside labels there is no room for its own."""
    row = layout.row()
    row.use_property_split = False
    row.prop(data, name)


def sentence(layout: Any, context: Any, text: str, icon: str) -> None:
    """A text over as many lines as it needs: Blender cuts off what is too long for one."""
    width = context.region.width / context.preferences.system.ui_scale
    # A letter takes about 6 pixels, icon and margins 60.
    lines = textwrap.wrap(text, max(16, int((width - 60) / 6)))
    column = layout.column(align=True)
    column.scale_y = 0.8
    for index, line in enumerate(lines):
        column.label(text=line, icon="BLANK1" if index else icon)


def readable(key: str) -> str:
    return key.replace("_", " ")


def edit_buttons(row: Any, items: str) -> None:
    column = row.column(align=True)
    for action, icon in (("ADD", "ADD"), ("REMOVE", "REMOVE")):
        button = column.operator(operators.EchocastEditList.bl_idname, text="", icon=icon)
        button.items, button.action = items, action


CLASSES = (
    EchocastShowSection,
    EchocastSelect,
    ECHOCAST_UL_outputs,
    ECHOCAST_UL_layers,
    ECHOCAST_PT_scan,
    ECHOCAST_PT_sensor,
    ECHOCAST_PT_medium,
    ECHOCAST_PT_results,
)


def register() -> None:
    for one in CLASSES:
        bpy.utils.register_class(one)


def unregister() -> None:
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
