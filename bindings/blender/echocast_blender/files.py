"""Files of scans."""

import os
import re
from pathlib import Path
from typing import Any

import bpy
import echocast as ec

from . import sensors
from .scan import Result

#: Endings of files of formats that do not have their name, nor begin with it.
ENDINGS = {"las2": "las", "hdf5": "h5"}


def check(context: Any) -> None:
    """ec.Error if the files that the scene asks for cannot be written, before anything is scanned."""
    for output in context.scene.echocast.outputs:
        if not output.enabled:
            continue
        if not output.format:
            allowed = ", ".join(name for name, _ in ec.formats())
            raise ec.ArgumentError(f"a file has a format of another version; allowed: {allowed}")
        names: "dict[Path, str]" = {}
        for thing in sensors.all_of(context.scene):
            folder = folder_of(output.path, thing.name)
            other = names.setdefault(folder / safe(thing.name), thing.name)
            if other != thing.name:
                both = f"the sensors {other} and {thing.name} have the same file name, {safe(other)}"
                raise ec.ArgumentError(f"{both}; allowed: different ones")
            there = next(one for one in (folder, *folder.parents) if one.exists())
            if not there.is_dir() or not os.access(there, os.W_OK):
                raise ec.ArgumentError(f"{there} is not a folder in which files can be made; allowed: one where they can")


def write(context: Any, result: Result) -> "list[str]":
    """Writes the files that the scene asks for; returns sentences about what they do not hold."""
    notes = []
    for output in context.scene.echocast.outputs:
        if output.enabled:
            notes += write_as(result, output.path, output.format)[1]
    return notes


def write_as(result: Result, folder: str, format: str) -> "tuple[Path, list[str]]":
    """Writes a file; returns its path, and sentences about what it does not hold."""
    task = result.task
    # Formats that share an ending do not share a file.
    ending = ENDINGS.get(format, format.split("_")[0])
    variant = "" if format in (ending, "hdf5") else f"_{format}"
    path = folder_of(folder, task.name) / f"{safe(task.name)}_{task.frame:04d}{variant}.{ending}"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ec.ArgumentError(f"the folder {path.parent} cannot be made: {error.strerror}") from error
    return path, result.cloud.write(path, format=format)


def folder_of(path: str, sensor: str) -> Path:
    """A folder as an absolute path; {sensor} in it stands for the name of the sensor."""
    if not path.strip():
        raise ec.ArgumentError("a file has no folder; allowed: one beside the .blend file, such as //scans, or an absolute path")
    if path.startswith("//") and not bpy.data.filepath:
        why = "is relative to the .blend file, which is not saved"
        raise ec.ArgumentError(f"the folder {path} {why}; allowed: save it, or an absolute path")
    return Path(bpy.path.abspath(path.replace("{sensor}", safe(sensor)))).absolute()


def safe(name: str) -> str:
    """A name as part of a file name."""
    return re.sub(r"[^\w.-]+", "_", name).strip("_") or "sensor"
