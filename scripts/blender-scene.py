"""Makes the scene in tests/data/scenes/blender and writes it as FBX, GLB, OBJ, PLY and STL.

    blender -b --factory-startup -P scripts/blender-scene.py -- tests/data/scenes/blender

Made with Blender 3.4.1 (Debian); the tests need the files, not Blender.
"""

import math
import os
import sys

import bpy

FOLDER = os.path.abspath(sys.argv[sys.argv.index("--") + 1])
FPS, LAST = 24, 48


def material(name, color, roughness=0.5, metallic=0.0, **properties):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = color
    shader.inputs["Roughness"].default_value = roughness
    shader.inputs["Metallic"].default_value = metallic
    for key, value in properties.items():
        made[key] = value
    return made


def textured(name, path):
    """A material with a small image: red and green squares, a quarter of it blue so that any rotation is noticed."""
    side = 16
    image = bpy.data.images.new("squares", side, side)
    pixels = []
    for row in range(side):
        for column in range(side):
            blue = row >= side // 2 and column < side // 2
            even = (row // 4 + column // 4) % 2
            pixels += [0.0, 0.0, 1.0, 1.0] if blue else [0.8, 0.1, 0.1, 1.0] if even else [0.1, 0.6, 0.1, 1.0]
    image.pixels = pixels
    image.filepath_raw = path
    image.file_format = "PNG"
    image.save()
    made = material(name, (1, 1, 1, 1))
    nodes = made.node_tree.nodes
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = image
    made.node_tree.links.new(texture.outputs["Color"], nodes["Principled BSDF"].inputs["Base Color"])
    return made


def last_added(name, parent, *materials):
    made = bpy.context.object
    made.name = made.data.name = name
    made.parent = parent
    for one in materials:
        made.data.materials.append(one)
    return made


def empty(name, parent=None, location=(0, 0, 0), degrees=0.0):
    made = bpy.data.objects.new(name, None)
    bpy.context.collection.objects.link(made)
    made.parent, made.location = parent, location
    made.rotation_euler = (0, 0, math.radians(degrees))
    return made


def cube(name, parent, size, location, *materials):
    bpy.ops.mesh.primitive_cube_add(size=1)
    made = last_added(name, parent, *materials)
    made.location, made.scale = location, size
    return made


def room(wood, brick, steel, glass):
    """The static objects and their hierarchy."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8, size=12)
    floor = last_added("Floor", None, brick, wood)
    for polygon in floor.data.polygons:
        polygon.material_index = int(polygon.center.x > 0)
    floor["categoryID"] = "ground"
    house = empty("House", location=(3, 2, 0), degrees=30)
    cube("Wall", house, (0.2, 4, 2.5), (0, 0, 1.25), brick)
    cube("Window", house, (0.02, 1.2, 1.0), (-0.6, 0, 1.5), glass)

    # A table is one thing of five pieces; its legs share a mesh.
    table = empty("Table", location=(-2, 1.5, 0), degrees=-20)
    table["categoryID"] = "furniture"
    cube("Top", table, (1.6, 0.9, 0.05), (0, 0, 0.75), wood)
    bpy.ops.mesh.primitive_cylinder_add(vertices=12, radius=0.04, depth=0.72)
    leg = last_added("Leg", table, steel)
    leg.location = (0.7, 0.35, 0.36)
    bpy.ops.object.shade_smooth()
    for number, (x, y) in enumerate([(-0.7, 0.35), (0.7, -0.35), (-0.7, -0.35)]):
        other = leg.copy()
        bpy.context.collection.objects.link(other)
        other.location = (x, y, 0.36)

    # A wedge without mirror symmetry, and its mirror image: the same mesh with a negative scale.
    corners = [(0, 0, 0), (1.2, 0, 0), (1.2, 0.6, 0), (0, 0.6, 0), (0, 0, 0.8), (0, 0.6, 0.5)]
    faces = [(3, 2, 1, 0), (0, 1, 4), (2, 3, 5), (1, 2, 5, 4), (3, 0, 4, 5)]
    mesh = bpy.data.meshes.new("Wedge")
    mesh.from_pydata(corners, [], [tuple(face) for face in faces])
    mesh.materials.append(steel)
    for name, x, scale in [("Wedge", 0.4, (1, 1, 1)), ("Mirrored", -0.4, (-1, 1, 1.5))]:
        made = bpy.data.objects.new(name, mesh)
        bpy.context.collection.objects.link(made)
        made.location, made.scale = (x, -3, 0), scale
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8, radius=0.5)
    ball = last_added("Ball", None, steel)
    ball.location = (-3.5, -2, 0.5)
    ball["partID"] = "shell"
    bpy.ops.object.shade_smooth()


def cart(squares):
    """A box that drives and turns, below an empty that is rotated and scaled."""
    track = empty("Track", location=(0, 3.5, 0), degrees=15)
    track.scale = (1, 1, 1.2)
    box = cube("Cart", track, (0.8, 0.5, 0.4), (0, 0, 0.3), squares)
    for frame, x, turn in [(0, -2.0, 0), (24, 0.0, 90), (LAST, 2.0, 60)]:
        box.location.x = x
        box.rotation_euler.z = math.radians(turn)
        box.keyframe_insert("location", frame=frame)
        box.keyframe_insert("rotation_euler", frame=frame)


def worm(wood):
    """A pillar that bends at two bones and swells in the middle by a shape key."""
    bpy.ops.mesh.primitive_cylinder_add(vertices=10, radius=0.25, depth=2)
    body = last_added("Worm", None, wood)
    body["categoryID"] = "worm"
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.bisect(plane_co=(0, 0, 0), plane_no=(0, 0, 1))
    bpy.ops.object.mode_set(mode="OBJECT")
    body.location = (-0.5, -1, 1)
    bpy.ops.object.transform_apply(location=True)

    bpy.ops.object.armature_add(location=(-0.5, -1, 0))
    rig = bpy.context.object
    rig.name = rig.data.name = "Rig"
    bpy.ops.object.mode_set(mode="EDIT")
    lower = rig.data.edit_bones[0]
    lower.name, lower.tail = "Lower", (0, 0, 1)
    upper = rig.data.edit_bones.new("Upper")
    upper.head, upper.tail, upper.parent = (0, 0, 1), (0, 0, 2), lower
    bpy.ops.object.mode_set(mode="OBJECT")
    for name, weigh in [("Lower", lambda z: 1 - z / 2), ("Upper", lambda z: z / 2)]:
        group = body.vertex_groups.new(name=name)
        for vertex in body.data.vertices:
            group.add([vertex.index], weigh(vertex.co.z), "REPLACE")
    body.parent = rig
    body.matrix_parent_inverse = rig.matrix_world.inverted()
    body.modifiers.new("Armature", "ARMATURE").object = rig

    body.shape_key_add(name="Basis")
    fat = body.shape_key_add(name="Fat")
    for point in fat.data:
        if 0.5 < point.co.z < 1.5:
            point.co.x = -0.5 + 1.6 * (point.co.x + 0.5)
            point.co.y = -1 + 1.6 * (point.co.y + 1)
    for frame, value in [(0, 0.0), (24, 1.0), (LAST, 0.25)]:
        fat.value = value
        fat.keyframe_insert("value", frame=frame)
    bone = rig.pose.bones["Upper"]
    bone.rotation_mode = "XYZ"
    for frame, turn in [(0, 0), (24, 50), (LAST, -30)]:
        bone.rotation_euler = (math.radians(turn), 0, math.radians(turn / 2))
        bone.keyframe_insert("rotation_euler", frame=frame)


def camera():
    made = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
    bpy.context.collection.objects.link(made)
    made.location = (0.5, -5, 1.6)
    made.rotation_euler = (math.radians(80), 0, math.radians(10))


def write():
    def path(name):
        return os.path.join(FOLDER, name)

    scene = bpy.context.scene
    scene.frame_set(0)
    bpy.ops.export_scene.fbx(
        filepath=path("scene.fbx"),
        use_custom_props=True,
        path_mode="COPY",
        embed_textures=True,
        # One animation of the whole scene, at the scene's own times.
        bake_anim_use_nla_strips=False,
        bake_anim_use_all_actions=False,
        # Bones exactly as in the armature.
        add_leaf_bones=False,
    )
    bpy.ops.export_scene.gltf(filepath=path("scene.glb"), export_extras=True, export_cameras=True)
    # These formats have no motion: the scene as it is at the start.
    bpy.ops.wm.obj_export(filepath=path("scene.obj"), export_animation=False, path_mode="RELATIVE")
    bpy.ops.object.select_all(action="DESELECT")
    meshes = [made for made in scene.objects if made.type == "MESH"]
    for made in meshes:
        made.select_set(True)
    bpy.ops.export_mesh.stl(filepath=path("scene.stl"), use_selection=True)
    # Blender writes one object to a PLY file. Animated objects would move again after their transforms are applied.
    for made in scene.objects:
        made.animation_data_clear()
    for made in meshes:
        made.shape_key_clear()
        made.modifiers.clear()
    bpy.context.view_layer.objects.active = meshes[0]
    bpy.ops.object.make_single_user(object=True, obdata=True)
    bpy.ops.object.parent_clear(type="CLEAR_KEEP_TRANSFORM")
    bpy.ops.object.transform_apply(location=True, rotation=True, scale=True)
    bpy.ops.object.join()
    bpy.ops.export_mesh.ply(filepath=path("scene.ply"), use_ascii=False, use_normals=True)


def main():
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.delete()
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = FPS, 0, LAST
    wood = material("wood", (0.5, 0.3, 0.15, 1), roughness=0.8)
    brick = material("brick", (0.6, 0.2, 0.15, 1), roughness=1.0, reflectance=0.35)
    steel = material("steel", (0.6, 0.6, 0.65, 1), roughness=0.3, metallic=0.5)
    glass = material("glass", (0.9, 0.9, 1.0, 0.25), roughness=0.1, pane_m=0.004)
    room(wood, brick, steel, glass)
    cart(textured("squares", os.path.join(FOLDER, "squares.png")))
    worm(wood)
    camera()
    write()


main()
