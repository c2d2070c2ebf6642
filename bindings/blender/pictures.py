"""Makes the pictures of docs/blender.md, and shows how the add-on looks.

    xvfb-run -s "-screen 0 1280x800x24" blender --factory-startup --enable-event-simulate --window-geometry 0 0 1060 660 \
        --python bindings/blender/pictures.py -- docs/pictures

The package echocast is on PYTHONPATH (with --python-use-system-env). Made with Blender 3.4.1 (Debian).
"""

import math
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
import echocast_blender  # noqa: E402

FOLDER = Path(sys.argv[sys.argv.index("--") + 1]).resolve()


# --- a corner of a street ---------------------------------------------------------------------------------------------


def material(name, color, metallic=0.0, roughness=0.6, transmission=0.0):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    inputs = made.node_tree.nodes["Principled BSDF"].inputs
    made.diffuse_color = inputs["Base Color"].default_value = (*color, 1.0)
    inputs["Metallic"].default_value, inputs["Roughness"].default_value = metallic, roughness
    inputs["Transmission" if "Transmission" in inputs else "Transmission Weight"].default_value = transmission
    return made


def named(name, paint, parent=None, bevel=0.0):
    """Names the object that was just added."""
    thing = bpy.context.object
    thing.name = name
    thing.data.materials.append(paint)
    if parent is not None:
        thing.parent = parent
    if bevel:
        modifier = thing.modifiers.new("Bevel", "BEVEL")
        modifier.width, modifier.segments = bevel, 3
    return thing


def box(name, size, place, paint, parent=None, bevel=0.0):
    bpy.ops.mesh.primitive_cube_add(size=1, location=place)
    thing = named(name, paint, parent, bevel)
    thing.scale = size
    bpy.ops.object.transform_apply(location=False, rotation=False)
    return thing


def tube(name, radius, length, place, paint, parent=None, turn=(0, 0, 0)):
    bpy.ops.mesh.primitive_cylinder_add(radius=radius, depth=length, location=place, rotation=turn, vertices=24)
    return named(name, paint, parent)


def group(name, place, turn=0.0):
    thing = bpy.data.objects.new(name, None)
    thing.location, thing.rotation_euler[2], thing.empty_display_size = place, turn, 0.2
    bpy.context.collection.objects.link(thing)
    return thing


def car(name, place, turn, paint):
    whole = group(name, place, turn)
    whole["categoryID"] = "car"
    dark, glass = bpy.data.materials["Rubber"], bpy.data.materials["Window glass"]
    box("Body", (4.3, 1.8, 0.6), (0, 0, 0.65), paint, whole, 0.15)
    box("Cabin", (2.1, 1.6, 0.55), (-0.2, 0, 1.2), glass, whole, 0.2)
    for x in (-1.35, 1.35):
        for y in (-0.85, 0.85):
            tube("Wheel", 0.33, 0.2, (x, y, 0.33), dark, whole, (math.pi / 2, 0, 0))
    return whole


def tree(name, place, seed):
    whole = group(name, place)
    whole["categoryID"] = "tree"
    tube("Trunk", 0.16, 2.6, (0, 0, 1.3), bpy.data.materials["Bark"], whole)
    for index, (x, y, z, radius) in enumerate(((0, 0, 3.6, 1.3), (0.7, 0.3, 3.0, 0.9), (-0.6, -0.4, 3.1, 0.95), (0.1, 0.6, 4.3, 0.8))):
        bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=4, radius=radius, location=(x, y, z))
        crown = named("Crown", bpy.data.materials["Leaves"], whole)
        texture = bpy.data.textures.new("Leaves", "CLOUDS")
        texture.noise_scale = 0.35
        modifier = crown.modifiers.new("Leaves", "DISPLACE")
        modifier.texture, modifier.strength, modifier.texture_coords = texture, 0.7, "GLOBAL"


def person(name, place, paint):
    whole = group(name, place)
    whole["categoryID"] = "person"
    for side in (-0.1, 0.1):
        tube("Leg", 0.09, 0.85, (0, side, 0.43), bpy.data.materials["Rubber"], whole)
    box("Torso", (0.28, 0.45, 0.62), (0, 0, 1.15), paint, whole, 0.1)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.13, location=(0, 0, 1.62))
    named("Head", bpy.data.materials["Plaster"], whole)


def house(name, size, place, wall):
    whole = group(name, place)
    whole["categoryID"] = "building"
    wide, deep, high = size
    box("Walls", size, (0, 0, high / 2), wall, whole)
    for row in range(int(high // 3)):
        for column in range(int(wide // 2.5)):
            x = (column - (wide // 2.5 - 1) / 2) * 2.5
            box("Window", (1.2, 0.06, 1.5), (x, -deep / 2, 1.8 + 3 * row), bpy.data.materials["Window glass"], whole)


def street():
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    for name, color, options in (
        ("Asphalt", (0.09, 0.09, 0.1), {}),
        ("Concrete", (0.42, 0.41, 0.39), {}),
        ("Brick", (0.45, 0.19, 0.12), {}),
        ("Plaster", (0.72, 0.62, 0.46), {}),
        ("Rubber", (0.03, 0.03, 0.03), {}),
        ("Window glass", (0.35, 0.5, 0.55), {"roughness": 0.05, "metallic": 0.3}),
        ("Red paint", (0.6, 0.05, 0.04), {"roughness": 0.3}),
        ("Blue paint", (0.05, 0.16, 0.45), {"roughness": 0.3}),
        ("Bark", (0.2, 0.12, 0.07), {}),
        ("Leaves", (0.13, 0.3, 0.06), {}),
        ("Cardboard", (0.45, 0.3, 0.16), {}),
        ("Steel", (0.5, 0.5, 0.52), {"metallic": 1.0, "roughness": 0.4}),
    ):
        material(name, color, **options)
    paint = bpy.data.materials
    box("Road", (44, 8, 0.1), (0, 0, -0.05), paint["Asphalt"])
    box("Pavement", (44, 4, 0.15), (0, 6, 0.025), paint["Concrete"])
    box("Pavement", (44, 4, 0.15), (0, -6, 0.025), paint["Concrete"])
    house("House", (12, 6, 7), (-9, 11, 0.1), paint["Brick"])
    house("House", (13, 6, 10), (6, 11, 0.1), paint["Plaster"])
    car("Car", (4.5, 1.9, 0), math.pi, paint["Red paint"])
    car("Car", (-6.5, -1.9, 0), 0, paint["Blue paint"])
    tree("Tree", (-2.2, 6.4, 0.1), 0)
    tree("Tree", (11.5, 5.4, 0.1), 1)
    person("Person", (1.5, 5.2, 0.1), paint["Red paint"])
    person("Person", (-8.2, 5.0, 0.1), paint["Blue paint"])
    for x, y, z in ((7.6, 6.6, 0.4), (8.4, 6.7, 0.4), (8.0, 6.65, 1.0)):
        box("Box", (0.6, 0.6, 0.6), (x, y, z), paint["Cardboard"])
    tube("Lamp", 0.07, 5, (-11.5, 4.6, 2.5), paint["Steel"])
    tube("Mast", 0.05, 1.75, (0, -4.6, 0.97), paint["Steel"])


# --- the window -------------------------------------------------------------------------------------------------------


def view():
    """The area of the 3D viewport, its space and its region."""
    area = next(one for one in bpy.context.window.screen.areas if one.type == "VIEW_3D")
    return area, area.spaces.active, next(one for one in area.regions if one.type == "WINDOW")


def override():
    area, _, region = view()
    return bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=area, region=region)


def look_at(place, turn, distance):
    from mathutils import Euler

    space = view()[1]
    space.region_3d.view_perspective = "PERSP"
    space.region_3d.view_location, space.region_3d.view_distance = place, distance
    space.region_3d.view_rotation = Euler([math.radians(angle) for angle in turn]).to_quaternion()


def click_tab():
    """Turns the wheel over the tabs of the sidebar, to the last."""
    area = view()[0]
    region = next(one for one in area.regions if one.type == "UI")
    x, y = region.x + region.width - 10, region.y + region.height // 2
    window = bpy.context.window_manager.windows[0]
    window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
    for _ in range(4):
        window.event_simulate("WHEELDOWNMOUSE", "PRESS", x=x, y=y)


def picture(name):
    with override():
        bpy.ops.screen.screenshot_area(filepath=str(FOLDER / name))


def clouds():
    return [one for one in bpy.data.objects if echocast_blender.scene.RESULT in one]


def steps():
    """What is done, one after another, with time for the window in between, s."""
    with override():
        bpy.ops.screen.screen_full_area()
    yield 1
    area, space, _ = view()
    space.show_region_ui = True
    space.show_region_toolbar = space.show_region_tool_header = False
    space.shading.light, space.shading.color_type, space.shading.show_cavity = "STUDIO", "MATERIAL", True
    settings = bpy.context.scene.render.image_settings
    settings.color_mode, settings.compression = "RGB", 100
    look_at((1, 3, 1), (62, 0, 18), 26)
    yield 2
    click_tab()
    yield 1

    bpy.context.scene.cursor.location = (0, -4.6, 1.95)
    with override():
        bpy.ops.echocast.add_sensor(preset="velodyne_vlp16")
    sensor = bpy.context.view_layer.objects.active
    sensor.rotation_euler[2] = math.pi / 2
    yield 2
    picture("blender-sensor.png")
    yield 1

    # The panel of results is nearer to the top if no sensor is selected.
    sensor.select_set(False)
    bpy.context.view_layer.objects.active = None
    sensor.echocast.show_view = False
    with override():
        bpy.ops.echocast.scan("INVOKE_DEFAULT")
    while not clouds():
        yield 0.5
    yield 2
    picture("blender-scan.png")
    yield 1

    sensor.echocast.preset = "ouster_os1_128"
    bpy.context.scene.echocast.color, bpy.context.scene.echocast.noise = "intensity", False
    with override():
        bpy.ops.echocast.scan()
    for thing in bpy.data.objects:
        thing.hide_set(thing not in clouds())
    space.show_region_ui = space.overlay.show_floor = False
    yield 3
    picture("blender-points.png")
    yield 1


running = steps()


def go_on():
    try:
        return next(running)
    except StopIteration:
        echocast_blender.unregister()
        bpy.ops.wm.quit_blender()
    except BaseException:
        import traceback

        traceback.print_exc()
        bpy.ops.wm.quit_blender()


bpy.context.preferences.view.show_splash = False
street()
echocast_blender.register()
bpy.app.timers.register(go_on, first_interval=2)
