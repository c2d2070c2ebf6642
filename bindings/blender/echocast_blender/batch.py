"""Scans without a window."""

import sys
from collections.abc import Iterable
from pathlib import Path

import bpy
import echocast as ec

from . import files, scan


def run(
    output: "str | None" = None, *, frames: "Iterable[int] | None" = None, format: str = "las", quiet: bool = False
) -> "list[Path]":
    """Scans the open scene with its enabled sensors and settings, and writes a file for each sensor and frame.

    `output`: their folder; None: those of the list of files in the scene, or the folder `scans` beside the .blend file.
    `frames`: numbers of frames; None: as the scene has it. `format`: that of files in `output`, one of `ec.formats()`.
    Returns the paths that it names itself, and raises ec.Error with a sentence where something is not allowed. The scene
    itself is not changed.
    """
    context = bpy.context
    begun = context.scene.frame_current
    listed = any(one.enabled for one in context.scene.echocast.outputs)
    folder = output if output is not None else None if listed else "//scans"
    known = {name for name, _ in ec.formats()}
    if format not in known:
        raise ec.ArgumentError(f"format is {format!r}; allowed: {', '.join(sorted(known))}")
    written: "list[Path]" = []
    numbers = list(frames) if frames is not None else scan.frames(context)
    told: "dict[str, None]" = {}
    try:
        for number in numbers:
            frame = scan.prepare(context, number)
            told.update(dict.fromkeys(frame.notes))
            for result in scan.run(frame, lambda fraction: True):
                told.update(dict.fromkeys(files.write(context, result)))
                if folder is not None:
                    place = files.folder_of(folder, result.task.name)
                    place.mkdir(parents=True, exist_ok=True)
                    path = place / f"{files.safe(result.task.name)}_{result.task.frame:04d}{files.ending(format)}"
                    told.update(dict.fromkeys(result.cloud.write(path, format=format)))
                    written.append(path)
                if not quiet:
                    print(f"echocast: {result.task.name}, frame {number}: {len(result.cloud):,} points")
    finally:
        if context.scene.frame_current != begun:
            context.scene.frame_set(begun)
    for sentence in told:
        print(f"echocast: {sentence}", file=sys.stderr)
    return written
