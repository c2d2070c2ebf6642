"""Files of scans."""

import re
from pathlib import Path
from typing import Any

import bpy
import echocast as ec

from .scan import Result


def write(context: Any, result: Result) -> "list[str]":
    """Writes the files that the scene asks for; returns sentences about what they do not hold."""
    notes = []
    for output in context.scene.echocast.outputs:
        if not output.enabled:
            continue
        folder = folder_of(output.path, result.task.name)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ec.ArgumentError(f"the folder {folder} cannot be made: {error.strerror}") from error
        path = folder / f"{safe(result.task.name)}_{result.task.frame:04d}{ending(output.format)}"
        notes += result.cloud.write(path, format=output.format)
    return notes


def folder_of(path: str, sensor: str) -> Path:
    if path.startswith("//") and not bpy.data.filepath:
        raise ec.ArgumentError(f"the folder {path} is relative to the .blend file, which is not saved; allowed: save it, or an absolute path")
    return Path(bpy.path.abspath(path.replace("{sensor}", safe(sensor))))


def safe(name: str) -> str:
    """A name as part of a file name."""
    return re.sub(r"[^\w.-]+", "_", name).strip("_") or "sensor"


def ending(format: str) -> str:
    kinds = {"las2": "las", "hdf5": "h5", "pcd_ascii": "pcd", "pcd_compressed": "pcd"}
    return "." + kinds.get(format, format.split("_")[0])
