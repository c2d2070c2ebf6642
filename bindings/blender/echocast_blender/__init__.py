"""Echocast in Blender: LiDARs, depth cameras and sonars scan the scene, and every point is labelled.

    blender -b scene.blend --python-expr "import echocast_blender; echocast_blender.run()"
"""

import sys

# Blender before 4.2 reads it from here, as text.
bl_info = {
    "name": "Echocast",
    "description": "Simulates LiDARs, depth cameras and sonars, every point labelled",
    "author": "The echocast developers",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "3D Viewport > Sidebar > Echocast",
    "category": "3D View",
}

from . import package

package.find()

from . import batch, operators, overlay, panels, paper, scene, sensors, settings  # noqa: E402
from .batch import animated_scene, program, run  # noqa: E402

MODULES = (sensors, settings, scene, paper, operators, panels, overlay)

__all__ = ["animated_scene", "program", "register", "run", "unregister"]


def register() -> None:
    for module in MODULES:
        module.register()
    # As an extension it has a longer name; scripts use this one.
    sys.modules.setdefault("echocast_blender", sys.modules[__name__])


def unregister() -> None:
    for module in reversed(MODULES):
        module.unregister()
