"""Meshes of several materials, with images."""

from typing import Any

import numpy as np
import pytest

import echocast as ec

SQUARE = np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]], dtype=np.float32)
TWO = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)
#: Of the corners of TWO: u along y, v along z.
UVS = np.array([[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]], dtype=np.float32)
CAMERA = {"name": "camera", "kind": "tof", "pattern": {"type": "pinhole", "resolution": [64, 64], "fov_deg": [40, 40]}}


def scanned(mesh: ec.Mesh, **options: Any) -> ec.PointCloud:
    """The square 4 m ahead, as a camera sees it."""
    live = ec.LiveScene()
    live.add_mesh(mesh, pose=(4, 0, 0), category=1, **options)
    return live.scan(CAMERA, at=(0, 0, 0), fields="default,material_id,part_id,red,green,blue")


def test_each_triangle_has_its_material_and_part() -> None:
    mesh = ec.Mesh(SQUARE, TWO, materials=["wood", "snow", ec.Material("asphalt_dry")], material_index=[2, 0])
    cloud = scanned(mesh, parts=[7, 8, 9])
    for side, material, part in ((cloud.y > cloud.z + 0.1, "asphalt_dry", 9), (cloud.y < cloud.z - 0.1, "wood", 7)):
        assert {cloud.materials[number] for number in set(cloud.material_id[side])} == {material}
        assert set(cloud.part_id[side]) == {part}


def test_images_are_the_right_way_up_and_share_vertices_across_seams() -> None:
    # Red above, blue below; green at the right, where y, which points to the left, is least.
    image = np.zeros((2, 2, 3), dtype=np.uint8)
    image[0, :, 0], image[1, :, 2], image[:, 0, 1] = 255, 255, 255
    material = ec.Material({"name": "squares"}, image=image, filter="nearest")
    cloud = scanned(ec.Mesh(SQUARE, TWO, materials=[material], uvs=UVS))
    assert len(cloud) > 1000
    assert set(cloud.red[cloud.z > 0.01]) == {255} and set(cloud.red[cloud.z < -0.01]) == {0}
    assert set(cloud.blue[cloud.z < -0.01]) == {255}
    assert set(cloud.green[cloud.y < -0.01]) == {255} and set(cloud.green[cloud.y > 0.01]) == {0}
    # Turned by a quarter about its middle: (u, v) to (v, 1 - u).
    turn = [[0, 1, 0], [-1, 0, 1], [0, 0, 1]]
    turned = ec.Material({"name": "turned"}, image=image, image_matrix=turn, filter="nearest")
    cloud = scanned(ec.Mesh(SQUARE, TWO, materials=[turned], uvs=UVS))
    assert set(cloud.red[cloud.y < -0.01]) == {255} and set(cloud.red[cloud.y > 0.01]) == {0}
    assert set(cloud.green[cloud.z < -0.01]) == {255} and set(cloud.green[cloud.z > 0.01]) == {0}


def test_a_mask_cuts_out() -> None:
    mask = np.zeros((2, 2), dtype=np.uint8)
    mask[0] = 255
    material = ec.Material({"name": "sheet", "alpha": "cutout"}, alpha_image=mask, filter="nearest")
    cloud = scanned(ec.Mesh(SQUARE, TWO, materials=[material], uvs=UVS))
    assert len(cloud) > 500 and cloud.z.min() > -0.01


def test_what_blends_lets_light_through_unless_it_is_glass() -> None:
    veil = {"name": "veil", "base_color": [0.5, 0.5, 0.5, 0.25]}
    solid, blended = (len(scanned(ec.Mesh(SQUARE, TWO, materials=[ec.Material(veil, blend=on)]))) for on in (False, True))
    assert 0.15 < blended / solid < 0.35
    pane = {**veil, "name": "window glass"}
    one, other = (scanned(ec.Mesh(SQUARE, TWO, materials=[ec.Material(pane, blend=on)])) for on in (False, True))
    assert len(one) == len(other)


def test_normals_shade_and_positions_stay() -> None:
    tilted = np.tile(np.array([-0.8, 0.6, 0], dtype=np.float32), (6, 1))
    live = ec.LiveScene()
    live.add_mesh(ec.Mesh(SQUARE, TWO, normals=tilted), pose=(4, 0, 0))
    flat = ec.LiveScene()
    flat.add_mesh(ec.Mesh(SQUARE, TWO), pose=(4, 0, 0))
    options: Any = {"at": (0, 0, 0), "fields": "default,cos_incidence"}
    shaded, plain = live.scan(CAMERA, **options), flat.scan(CAMERA, **options)
    assert np.array_equal(shaded.range, plain.range)
    assert 0.7 < shaded.cos_incidence.mean() < 0.85 < plain.cos_incidence.mean()


def test_vertices_of_a_mesh_with_seams_can_be_moved() -> None:
    uvs = UVS.copy()
    uvs[3] = 0.5, 0.5
    image = np.zeros((2, 2, 3), dtype=np.uint8)
    mesh = ec.Mesh(SQUARE, TWO, materials=[ec.Material({"name": "image"}, image=image)], uvs=uvs)
    live = ec.LiveScene()
    number = live.add_mesh(mesh, category=1)
    live.set_vertices(number, SQUARE + np.array([4, 0, 0], np.float32))
    assert abs(np.median(live.scan("velodyne_vlp16", at=(0, 0, 0)).x) - 4) < 0.05
    live.set_vertex_motion(number, [0.0, 2.0], [SQUARE + np.array([x, 0, 0], np.float32) for x in (5, 9)])
    live.set_time(1.0)
    assert abs(np.median(live.scan("velodyne_vlp16", at=(0, 0, 0)).x) - 7) < 0.05
    with pytest.raises(ec.ArgumentError, match="as many as before"):
        live.set_vertices(number, SQUARE[:3])


def test_objects_of_one_mesh_share_its_memory_and_may_be_far_away() -> None:
    far = SQUARE.astype(np.float64) + [1e6, 0, 0]
    mesh = ec.Mesh(far, TWO, name="sign")
    live = ec.LiveScene()
    for y in (-2, 2):
        live.add_mesh(mesh, pose=(0, y, 0))
    assert list(live.objects.values()) == ["sign", "sign"]
    cloud = live.scan("velodyne_vlp16", at=(1e6 - 4, 0, 0))
    assert abs(np.median(cloud.x + cloud.origin[0]) - 1e6) < 0.05


@pytest.mark.parametrize(
    ("arguments", "allowed"),
    [
        (dict(materials=["wood"], material_index=[0, 1]), "below the number of materials, 1"),
        (dict(material_index=[0]), "one for each triangle"),
        (dict(uvs=UVS[:5]), "6, one for each corner"),
        (dict(normals=np.zeros((6, 2))), "n x 3"),
        (dict(materials=["wod"]), "wood"),
    ],
)
def test_wrong_arrays_are_errors(arguments: Any, allowed: str) -> None:
    with pytest.raises(ec.Error, match=allowed):
        ec.Mesh(SQUARE, TWO, **arguments)


@pytest.mark.parametrize(
    ("arguments", "error", "allowed"),
    [
        (dict(image=np.zeros((2, 2, 3))), TypeError, "uint8"),
        (dict(image=np.zeros((0, 2, 3), np.uint8)), ec.ArgumentError, "1 to 16384"),
        (dict(image=np.zeros((2, 2, 5), np.uint8)), ec.ArgumentError, "3 or 4"),
        (dict(alpha_image=np.zeros((2, 2, 3), np.uint8)), TypeError, "height x width"),
        (dict(image_matrix=np.eye(2)), ec.ArgumentError, "n x 3"),
        (dict(wrap="round"), ec.ArgumentError, "mirrored_repeat"),
        (dict(filter="cubic"), ec.ArgumentError, "nearest"),
    ],
)
def test_wrong_images_are_errors(arguments: Any, error: type[Exception], allowed: str) -> None:
    with pytest.raises(error, match=allowed):
        ec.Material({"name": "wrong"}, **arguments)


def test_wrong_objects_of_meshes_are_errors() -> None:
    live, mesh = ec.LiveScene(), ec.Mesh(SQUARE, TWO, materials=["wood", "snow"])
    with pytest.raises(ec.ArgumentError, match="2, one for each material"):
        live.add_mesh(mesh, parts=[1])
    with pytest.raises(TypeError, match="a Mesh"):
        live.add_mesh(SQUARE)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="a list of materials"):
        ec.Mesh(SQUARE, TWO, materials="wood")
