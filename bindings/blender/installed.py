"""Installs the add-on as people do, with no settings of theirs, and scans a small scene with what was installed.

    blender -b --factory-startup --python-exit-code 1 --python installed.py -- ZIP FOLDER
    python installed.py -- ZIP FOLDER              where the module bpy is installed

FOLDER is that of the user's files, in which the add-on must come to be; the scene is saved there as scene.blend. Prints
`installed` at the end: Blender ends with 0 if there is no such script.
"""

import os
import sys
from pathlib import Path

import bpy

ZIP, FOLDER = map(Path, sys.argv[sys.argv.index("--") + 1 :])


def install() -> str:
    """Installs and enables it; returns the name of its module."""
    if bpy.app.version >= (4, 2):
        bpy.ops.extensions.package_install_files(filepath=str(ZIP), repo="user_default", enable_on_install=True)
        return "bl_ext.user_default.echocast_blender"
    bpy.ops.preferences.addon_install(filepath=str(ZIP))
    bpy.ops.preferences.addon_enable(module="echocast_blender")
    return "echocast_blender"


module = install()
assert module in bpy.context.preferences.addons, list(bpy.context.preferences.addons.keys())
# For the next start of Blender.
bpy.ops.wm.save_userpref()

import echocast  # noqa: E402
import echocast_blender  # noqa: E402

assert echocast_blender is sys.modules[module]
for one in (echocast, echocast_blender):
    assert FOLDER in Path(one.__file__).parents, one.__file__

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.preferences.addon_enable(module=module)
bpy.ops.mesh.primitive_plane_add(size=30)
bpy.context.object.name = "Ground"
bpy.ops.mesh.primitive_cube_add(location=(5, 0, 1))
bpy.context.object.name = "Car"
bpy.context.scene.cursor.location = (0, 0, 1.8)
assert bpy.ops.echocast.add_sensor(preset="velodyne_vlp16") == {"FINISHED"}
bpy.context.object.name = "Lidar"
assert bpy.ops.echocast.scan() == {"FINISHED"}
clouds = [one for one in bpy.data.objects if "echocast_scan" in one]
assert len(clouds) == 1 and len(clouds[0].data.vertices) > 5000
bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "scene.blend"))
written = echocast_blender.run(str(FOLDER / "scans"), quiet=True)
cloud = echocast.PointCloud.read(written[0])
assert len(cloud) == len(clouds[0].data.vertices), cloud
assert set(cloud.categories.values()) >= {"Ground", "Car"}, cloud.categories

# It can be switched off and on again.
for operator in (bpy.ops.preferences.addon_disable, bpy.ops.preferences.addon_enable):
    assert operator(module=module) == {"FINISHED"}
assert bpy.ops.echocast.scan() == {"FINISHED"}
print("installed", flush=True)
if not bpy.app.binary_path and bpy.app.version < (4, 3):
    # The module of Blender 4.2 crashes when Python ends after functions of properties were registered, whosever they are.
    os._exit(0)
