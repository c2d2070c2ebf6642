"""Panels in the sidebar of the 3D viewport, and the list of what was approximated."""

import json
from typing import Any

import bpy

from . import operators, scene, sensors


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
        for thing in found:
            line = layout.row(align=True)
            line.use_property_split = False
            line.prop(thing.echocast, "enabled", text="")
            line.label(text=thing.name, icon="ERROR" if thing.echocast.fault else "OUTLINER_OB_LIGHTPROBE")
        layout.operator(operators.EchocastAddSensor.bl_idname, text="Add Sensor", icon="ADD")
        layout.prop(wanted, "frames")
        if wanted.frames == "RANGE":
            layout.prop(wanted, "step")
        for name in ("motion", "noise", "seed", "profile"):
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
        layout.active = own.is_sensor
        layout.prop(own, "preset", icon="VIEWZOOM")
        if own.fault:
            layout.label(text=own.fault, icon="ERROR")
        layout.prop(own, "show_view")
        if own.show_view:
            layout.prop(own, "view_length")
        if not own.parameters:
            return
        changed = sum(one.is_changed() for one in own.parameters)
        row = layout.row()
        row.label(text=f"{changed} parameters changed" if changed != 1 else "1 parameter changed")
        row.operator(operators.EchocastResetParameters.bl_idname, text="", icon="LOOP_BACK")
        for section in own.sections():
            box = layout.column(align=True)
            shown = own.section == section
            switch = box.operator(EchocastShowSection.bl_idname, text=section.replace("_", " ").title(), emboss=False,
                icon="DISCLOSURE_TRI_DOWN" if shown else "DISCLOSURE_TRI_RIGHT")
            switch.section = "" if shown else section
            if not shown:
                continue
            for one in own.parameters:
                if one.name.split(".")[0] == section:
                    line = box.row()
                    line.alert = one.is_changed()
                    line.prop(one, one.field(), text=one.name.partition(".")[2].replace("_", " ") or one.name)


class EchocastShowSection(bpy.types.Operator):
    """Show or hide the parameters of a section"""

    bl_idname = "echocast.show_section"
    bl_label = "Show Section"
    bl_options = {"INTERNAL"}

    section: bpy.props.StringProperty()

    def execute(self, context: Any) -> "set[str]":
        context.object.echocast.section = self.section
        return {"FINISHED"}


class ECHOCAST_PT_medium(Panel, bpy.types.Panel):
    bl_label = "Weather and Water"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        layout, wanted = self.layout, context.scene.echocast
        layout.use_property_split, layout.use_property_decorate = True, False
        for name, details in (("fog", "visibility"), ("rain", "rain_rate"), ("snow", "snow_rate")):
            layout.prop(wanted, name)
            if getattr(wanted, name):
                layout.prop(wanted, details)
        layout.prop(wanted, "water")
        if wanted.water:
            layout.prop(wanted, "surface")
            if not wanted.layers:
                layout.prop(wanted, "temperature")
                layout.prop(wanted, "salinity")
            row = layout.row()
            row.template_list("UI_UL_list", "echocast_layers", wanted, "layers", wanted, "layer", rows=3)
            edit_buttons(row, "layers")
            if wanted.layers:
                layer = wanted.layers[min(wanted.layer, len(wanted.layers) - 1)]
                for name in ("depth", "speed", "density"):
                    layout.prop(layer, name)
        layout.prop(wanted, "keys")


class ECHOCAST_PT_results(Panel, bpy.types.Panel):
    bl_label = "Results"

    def draw(self, context: Any) -> None:
        layout, wanted = self.layout, context.scene.echocast
        layout.use_property_split, layout.use_property_decorate = True, False
        for name in ("clouds", "color", "radius", "columns", "images"):
            layout.prop(wanted, name)
        layout.label(text="Files")
        row = layout.row()
        row.template_list("ECHOCAST_UL_outputs", "", wanted, "outputs", wanted, "output", rows=2)
        edit_buttons(row, "outputs")
        if wanted.outputs:
            output = wanted.outputs[min(wanted.output, len(wanted.outputs) - 1)]
            layout.prop(output, "format")
            layout.prop(output, "path")
        thing = context.object
        if thing is not None and scene.RESULT in thing:
            layout.operator(operators.EchocastExplain.bl_idname, icon="QUESTION")
        for note in json.loads(wanted.notes or "[]")[:8]:
            layout.label(text=note, icon="INFO")


class ECHOCAST_UL_outputs(bpy.types.UIList):
    def draw_item(self, _context: Any, layout: Any, _data: Any, item: Any, _icon: Any, _active: Any, _name: Any) -> None:
        layout.prop(item, "enabled", text="")
        layout.label(text=f"{item.format.upper()}  {item.path}")


def edit_buttons(row: Any, items: str) -> None:
    column = row.column(align=True)
    for action, icon in (("ADD", "ADD"), ("REMOVE", "REMOVE")):
        button = column.operator(operators.EchocastEditList.bl_idname, text="", icon=icon)
        button.items, button.action = items, action


CLASSES = (
    EchocastShowSection,
    ECHOCAST_UL_outputs,
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
