"""Scans and scenarios without a window."""

import atexit
import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bpy
import echocast as ec

from . import files, operators, scan


def run(
    output: "str | None" = None, *, frames: "Iterable[int] | None" = None, format: str = "las", quiet: bool = False
) -> "list[Path]":
    """Scans the open scene with its enabled sensors and settings, and writes a file for each sensor and frame.

    `output`: their folder; None: those of the list of files in the scene, or the folder `scans` beside the .blend file.
    `frames`: numbers of frames; None: as the scene has it. `format`: that of files in `output`, one of `ec.formats()`.
    Returns the paths that it names itself, and raises ec.Error with a sentence where something is not allowed. The scene
    itself is not changed.
    """
    enable()
    check_idle()
    context = bpy.context
    listed = any(one.enabled for one in context.scene.echocast.outputs)
    folder = output if output is not None else None if listed else "//scans"
    known = {name for name, _ in ec.formats()}
    if format not in known:
        raise ec.ArgumentError(f"format is {format!r}; allowed: {', '.join(sorted(known))}")
    files.check(context)
    written: "list[Path]" = []
    numbers = list(frames) if frames is not None else scan.frames(context)
    told: "dict[str, None]" = {}
    with scan.same_frame(context.scene):
        for number in numbers:
            frame = scan.prepare(context, number)
            told.update(dict.fromkeys(frame.notes))
            for result in scan.run(frame, lambda fraction: True):
                told.update(dict.fromkeys([*result.notes, *files.write(context, result)]))
                if folder is not None:
                    path, notes = files.write_as(result, folder, format)
                    told.update(dict.fromkeys(notes))
                    written.append(path)
                if not quiet:
                    print(f"echocast: {result.task.name}, frame {number}: {len(result.cloud):,} points")
    for sentence in told:
        print(f"echocast: {sentence}", file=sys.stderr)
    return written


def enable() -> None:
    """Registers the add-on where Blender has not: started with factory settings, or as a module."""
    from . import register

    if not hasattr(bpy.types.Scene, "echocast"):
        register()
        # As a module, Blender 4.5 does not end otherwise.
        atexit.register(disable)


def disable() -> None:
    from . import unregister

    if hasattr(bpy.types.Scene, "echocast"):
        unregister()


def check_idle() -> None:
    if operators.EchocastScan.running:
        raise ec.ArgumentError(operators.BUSY)


def animated_scene(context: Any = None) -> ec.Scene:
    """The open scene as an `ec.Scene`, with what moves over its range of frames, and a camera node for each sensor and
    camera. Times are those of the animation: frame 0 is at 0 s."""
    check_idle()
    context = context or bpy.context
    timeline = context.scene
    scale, rate = timeline.unit_settings.scale_length, scan.frame_rate(timeline)
    numbers = [float(number) for number in range(timeline.frame_start, timeline.frame_end + 1)]
    if not scan.is_animated(timeline):
        numbers = numbers[:1]
    times = [number / rate for number in numbers]
    with scan.same_frame(timeline):
        timeline.frame_set(int(numbers[0]))
        exported = scan.read(context)
        named = [one for one in timeline.objects if one.echocast.is_sensor or one.type == "CAMERA"]
        paths = {one.name: [scan.pose(context, one, scale)] for one in named}
        scan.follow(context, exported, paths, numbers, times)
        for sentence in dict.fromkeys(exported.notes):
            print(f"warning: {sentence}", file=sys.stderr)
        return exported.live.to_scene(cameras={name: scan.trajectory(times, path) for name, path in paths.items()})


def program(arguments: "list[str]") -> int:
    """Runs the command line `arguments` of the program `echocast`, such as `["run", "drive.yaml"]`, where the scene of
    scenarios is the open one; returns its exit code."""
    from echocast import _echocast

    enable()
    try:
        scene_read = animated_scene()
    except ec.Error as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    # What Blender writes is on stderr; file 3, if there is one, is what was stdout.
    sys.stdout.flush()
    try:
        os.dup2(3, 1)
    except OSError:
        pass
    return _echocast.program(["echocast", *arguments], scene_read)
