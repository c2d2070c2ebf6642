"""Reads sets as their users do and prints what is in them as JSON; anything that does not fit together is an error.

usage: sets.py kitti|nuscenes|webdataset FOLDER

KITTI by the rules of its object and semantic development kits in numpy, nuScenes by those of its schema and by
nuscenes-devkit, WebDataset by the package of that name.
"""

import io
import json
import sys
from pathlib import Path

import numpy
from PIL import Image


def turn(quaternion):
    """Matrix of a rotation, from w, x, y, z."""
    w, x, y, z = quaternion
    return numpy.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def png_size(path):
    head = path.read_bytes()[:24]
    assert head[:8] == b"\x89PNG\r\n\x1a\n"
    return int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")


def kitti(root):
    training = root / "training"
    listed = []
    for part in sorted((root / "ImageSets").iterdir()):
        listed += part.read_text().split()
    names = sorted(path.stem for path in (training / "velodyne").iterdir())
    assert sorted(listed) == names and names
    found = {"frames": len(names), "objects": {}, "pixels": {}}
    found |= {"points_in_boxes": 0, "boxes_with_points": 0, "truncated": 0, "alone_met": 0}
    found |= {"standing": 0, "standing_leaning": 0}
    movers = moving_sizes(root.parent / "nuscenes")
    for name in names:
        points = numpy.fromfile(training / f"velodyne/{name}.bin", numpy.float32).reshape(-1, 4)
        assert numpy.isfinite(points).all() and points[:, 3].min() >= 0 and points[:, 3].max() <= 1
        calibration = {}
        for line in (training / f"calib/{name}.txt").read_text().splitlines():
            key, _, numbers = line.partition(":")
            calibration[key] = numpy.array(numbers.split(), float)
        assert list(calibration) == ["P0", "P1", "P2", "P3", "R0_rect", "Tr_velo_to_cam", "Tr_imu_to_velo"]
        camera = calibration["P2"].reshape(3, 4)
        rectified = calibration["R0_rect"].reshape(3, 3)
        to_camera = calibration["Tr_velo_to_cam"].reshape(3, 4)
        assert abs(numpy.linalg.det(to_camera[:, :3]) - 1) < 1e-9
        seen = (rectified @ (to_camera[:, :3] @ points[:, :3].T + to_camera[:, 3:])).T
        width, height = png_size(training / f"image_2/{name}.png")
        cars, masks = [], kitti_masks(training, name, (height, width), found["pixels"])
        for line in (training / f"label_2/{name}.txt").read_text().splitlines():
            of, *words = line.split(" ")
            truncated, occluded, alpha, left, top, right, bottom, h, w, l, x, y, z, turned = map(float, words)
            assert of in ("Car", "Van", "Truck", "Pedestrian", "Person_sitting", "Cyclist", "Tram", "Misc"), of
            assert 0 <= truncated < 1 and occluded in (0, 1, 2, 3) and abs(alpha) <= 3.1416 and abs(turned) <= 3.1416
            assert 0 <= left < right <= width - 1 and 0 <= top < bottom <= height - 1
            around = (turned - numpy.arctan2(x, z) - alpha) / (2 * numpy.pi)
            assert abs(around - round(around)) < 1e-4
            found["objects"][of] = found["objects"].get(of, 0) + 1
            found["truncated"] += truncated > 0
            found["alone_met"] += occluded == 3
            stands = not any(numpy.allclose([w, l, h], size, atol=1e-3) for size in movers)
            if of in ("Car", "Van"):
                cars.append([left, top, right, bottom])
            # The box as the development kit has it: about the camera's y axis, its place in the middle of its lower face.
            cos, sin = numpy.cos(turned), numpy.sin(turned)
            axes = numpy.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
            ends = [[a, b, c] for a in (-l / 2, l / 2) for b in (-h, 0) for c in (-w / 2, w / 2)]
            corners = numpy.array(ends) @ axes.T + [x, y, z]
            if corners[:, 2].min() > 0.1:
                flat = camera @ numpy.vstack([corners.T, numpy.ones(8)])
                flat = flat[:2] / flat[2]
                ends = numpy.array([flat.min(axis=1), flat.max(axis=1)]).clip(0, [width - 1, height - 1])
                away = numpy.abs(ends - [[left, top], [right, bottom]]).max()
                # What leans does so in the image alone; what moves is in the image where the camera sees it.
                assert away < 2
                found["standing"] += stands
                found["standing_leaning"] += bool(stands and away > 0.01)
            own = (seen - [x, y, z]) @ axes
            within = (numpy.abs(own[:, 0]) < l / 2 + 0.1) & (numpy.abs(own[:, 2]) < w / 2 + 0.1)
            within &= (own[:, 1] < -0.1) & (own[:, 1] > -h - 0.1)
            found["points_in_boxes"] += int(within.sum())
            found["boxes_with_points"] += bool(within.any())
        # What is seen of each car lies in a box; some that are far away have none of the pixels.
        assert len(masks) <= len(cars), name
        for rows, columns in masks:
            ends = numpy.array([columns.min(), rows.min(), -columns.max(), -rows.max()])
            around = [box for box in cars if (ends >= numpy.multiply(box, [1, 1, -1, -1]) - 1).all()]
            assert around, (name, ends, cars)
    return found


def moving_sizes(root):
    """Width, length and height of what moves, as the same set in nuScenes' layout says."""
    (tables,) = root.glob("v1.0-*")
    read = lambda name: json.loads((tables / f"{name}.json").read_text())
    moving = {row["token"] for row in read("attribute") if row["name"].endswith((".moving", ".with_rider"))}
    return [row["size"] for row in read("sample_annotation") if moving & set(row["attribute_tokens"])]


def kitti_masks(training, name, shape, pixels):
    """Counts the pixels of each class; where each car is, rows and columns."""
    classes, both = (numpy.asarray(Image.open(training / f"{of}/{name}.png")) for of in ("semantic", "instance"))
    assert (classes.dtype, both.dtype) == (numpy.uint8, numpy.uint16) and classes.shape == both.shape == shape
    assert (both >> 8 == classes).all()
    for number, count in zip(*numpy.unique(classes, return_counts=True)):
        pixels[int(number)] = pixels.get(int(number), 0) + int(count)
        numbers = numpy.unique(both[classes == number] & 255)
        assert (numbers == numpy.arange(len(numbers)) + (numbers[0] > 0)).all(), "instances count from 1"
    return [numpy.nonzero(both == number) for number in numpy.unique(both[(classes == 26) & (both & 255 > 0)])]


def nuscenes(root):
    versions = [path.parent for path in root.glob("*/sample_annotation.json")]
    assert len(versions) == 1
    names = ["attribute", "calibrated_sensor", "category", "ego_pose", "instance", "log", "map", "sample"]
    names += ["sample_annotation", "sample_data", "scene", "sensor", "visibility", "lidarseg"]
    tables = {name: json.loads((versions[0] / f"{name}.json").read_text()) for name in names}
    rows = {name: {row["token"]: row for row in table} for name, table in tables.items()}
    assert all(len(rows[name]) == len(table) for name, table in tables.items()), "tokens are not unique"
    assert all(len(token) == 32 for name in names if name != "visibility" for token in rows[name])
    # Whatever ends in _token is a row of the table of that name.
    for name, table in tables.items():
        for row in table:
            for key, value in row.items():
                if key in ("prev", "next"):
                    assert value == "" or value in rows[name], (name, key)
                elif key in ("first_sample_token", "last_sample_token"):
                    assert value in rows["sample"]
                elif key in ("first_annotation_token", "last_annotation_token"):
                    assert value in rows["sample_annotation"]
                elif key.endswith("_token"):
                    assert value in rows[key[: -len("_token")]], (name, key, value)
                elif key.endswith("_tokens"):
                    assert all(one in rows[key[: -len("_tokens")]] for one in value), (name, key)

    def chain(name, first, time):
        """The rows from `first` on, which lead back the same way, at rising times."""
        found, before = [], ""
        while first:
            row = rows[name][first]
            assert row["prev"] == before and (not found or time(found[-1]) < time(row))
            found.append(row)
            before, first = first, row["next"]
        return found

    stamp = lambda row: row["timestamp"]
    frames = 0
    for scene in tables["scene"]:
        samples = chain("sample", scene["first_sample_token"], stamp)
        assert samples[-1]["token"] == scene["last_sample_token"] and len(samples) == scene["nbr_samples"]
        assert all(sample["scene_token"] == scene["token"] for sample in samples)
        frames += len(samples)
        steps = [b["timestamp"] - a["timestamp"] for a, b in zip(samples, samples[1:])]
        assert all(step == 500_000 for step in steps), steps
    assert frames == len(tables["sample"])
    of = lambda row: rows["sample"][row["sample_token"]]
    for instance in tables["instance"]:
        boxes = chain("sample_annotation", instance["first_annotation_token"], lambda row: of(row)["timestamp"])
        assert len(boxes) == instance["nbr_annotations"] and boxes[-1]["token"] == instance["last_annotation_token"]
        assert all(box["instance_token"] == instance["token"] for box in boxes)
    linked = sum(instance["nbr_annotations"] for instance in tables["instance"])
    assert linked == len(tables["sample_annotation"])

    channel = lambda row: rows["sensor"][rows["calibrated_sensor"][row["calibrated_sensor_token"]]["sensor_token"]]
    keys = {}
    starts = [row["token"] for row in tables["sample_data"] if not row["prev"]]
    seen = sum(len(chain("sample_data", first, stamp)) for first in starts)
    assert seen == len(tables["sample_data"])
    files = [row["filename"] for row in tables["sample_data"]] + [row["filename"] for row in tables["lidarseg"]]
    assert len(set(files)) == len(files) and all((root / name).is_file() for name in files)
    on_disk = [path for kind in ("samples", "sweeps", "lidarseg") for path in (root / kind).rglob("*") if path.is_file()]
    assert len(on_disk) == len(files)
    for row in tables["sample_data"]:
        sensor = channel(row)
        assert row["filename"].startswith(("samples/" if row["is_key_frame"] else "sweeps/") + sensor["channel"])
        assert rows["ego_pose"][row["ego_pose_token"]]["timestamp"] == row["timestamp"]
        if row["is_key_frame"]:
            assert keys.setdefault((row["sample_token"], sensor["channel"]), row) is row
        if sensor["modality"] == "camera":
            assert png_size(root / row["filename"]) == (row["width"], row["height"])
    for sample in tables["sample"]:
        assert keys[sample["token"], "LIDAR_TOP"]["timestamp"] == sample["timestamp"]

    def points_of(row):
        points = numpy.fromfile(root / row["filename"], numpy.float32).reshape(-1, 5)
        assert numpy.isfinite(points).all() and points[:, 3].min() >= 0 and points[:, 3].max() <= 255
        assert (points[:, 4] == numpy.round(points[:, 4])).all() and points[:, 4].min() >= 0
        return points

    def world(row, points):
        mount = rows["calibrated_sensor"][row["calibrated_sensor_token"]]
        carrier = rows["ego_pose"][row["ego_pose_token"]]
        points = points @ turn(mount["rotation"]).T + mount["translation"]
        return points @ turn(carrier["rotation"]).T + carrier["translation"]

    index_of = {row["name"]: row["index"] for row in tables["category"]}
    assert sorted(index_of.values()) == list(range(len(index_of)))
    classes = {}
    annotated = {}
    for box in tables["sample_annotation"]:
        annotated.setdefault(box["sample_token"], []).append(box)
    counted, inside, all_of, within_any = 0, 0, 0, 0
    for labels in tables["lidarseg"]:
        data = rows["sample_data"][labels["sample_data_token"]]
        points = points_of(data)
        numbers = numpy.fromfile(root / labels["filename"], numpy.uint8)
        assert len(numbers) == len(points)
        for number, count in zip(*numpy.unique(numbers, return_counts=True)):
            classes[int(number)] = classes.get(int(number), 0) + int(count)
        if channel(data)["channel"] != "LIDAR_TOP":
            continue
        places = world(data, points[:, :3])
        covered = numpy.zeros(len(points), bool)
        for box in annotated.get(data["sample_token"], []):
            name = rows["category"][rows["instance"][box["instance_token"]]["category_token"]]["name"]
            own = (places - box["translation"]) @ turn(box["rotation"])
            width, length, height = box["size"]
            out = numpy.abs(own) - numpy.array([length, width, height]) / 2
            within = (out < 0.15).all(axis=1)
            # As many as are in the box, up to what is right at its faces.
            edge = [int((out < by).all(axis=1).sum()) for by in (-1e-4, 1e-4)]
            assert edge[0] <= box["num_lidar_pts"] <= edge[1], (edge, box)
            counted += box["num_lidar_pts"]
            inside += min(box["num_lidar_pts"], int((within & (numbers == index_of[name])).sum()))
            covered |= (out < 0.05).all(axis=1) & (numbers == index_of[name])
        drives = numpy.isin(numbers, [index_of["vehicle.car"], index_of["vehicle.truck"]])
        all_of, within_any = all_of + int(drives.sum()), within_any + int((covered & drives).sum())
    # Points of other objects may be in a box, and what walks swings out of that of a moment.
    assert inside >= 0.95 * counted > 0, (inside, counted)
    # Boxes are where what drives was when it was scanned.
    assert within_any >= 0.995 * all_of > 0, (within_any, all_of)

    parts = json.loads((versions[0] / "splits.json").read_text())
    scenes = [scene for part in parts.values() for scene in part]
    assert sorted(scenes) == sorted(scene["name"] for scene in tables["scene"])
    return {
        "counts": {name: len(table) for name, table in tables.items()},
        "channels": sorted(row["channel"] for row in tables["sensor"]),
        "classes": {row["name"]: classes[row["index"]] for row in tables["category"] if row["index"] in classes},
        **devkit(root, versions[0].name, tables, classes),
    }


def devkit(root, version, tables, classes):
    """Reads the set by nuscenes-devkit, given its tables and how many points are of each class."""
    from nuscenes.lidarseg.lidarseg_utils import get_stats
    from nuscenes.nuscenes import NuScenes
    from nuscenes.utils.data_classes import LidarPointCloud
    from nuscenes.utils.data_io import load_bin_file
    from nuscenes.utils.geometry_utils import points_in_box
    from nuscenes.utils.splits import get_scenes_of_split

    nusc = NuScenes(version=version, dataroot=str(root), verbose=False)
    for name, table in tables.items():
        assert [row["token"] for row in getattr(nusc, name)] == [row["token"] for row in table], name
    counts = numpy.zeros(len(nusc.category), int)
    counted, inside, pictured = 0, 0, 0
    for sample in nusc.sample:
        for channel, token in sample["data"].items():
            path, boxes, intrinsic = nusc.get_sample_data(token)
            if channel != "LIDAR_TOP":
                assert Path(path).is_file() and numpy.shape(intrinsic) == (3, 3)
                pictured += len(boxes)
                continue
            assert sorted(box.token for box in boxes) == sorted(sample["anns"])
            points = LidarPointCloud.from_file(path).points[:3]
            labels = load_bin_file(str(root / nusc.get("lidarseg", token)["filename"]), "lidarseg")
            assert len(labels) == points.shape[1]
            counts += get_stats(labels, len(counts))
            for box in boxes:
                hit = points_in_box(box, points, wlh_factor=1.1) & (labels == nusc.lidarseg_name2idx_mapping[box.name])
                told = nusc.get("sample_annotation", box.token)["num_lidar_pts"]
                counted, inside = counted + told, inside + min(told, int(hit.sum()))
        cloud, times = LidarPointCloud.from_file_multisweep(nusc, sample, "LIDAR_TOP", "LIDAR_TOP", nsweeps=3)
        assert cloud.points.shape[1] == times.shape[1]
    assert {number: count for number, count in enumerate(counts) if count} == classes
    assert inside >= 0.9 * counted > 0, (inside, counted)
    speeds = {}
    for box in nusc.sample_annotation:
        speed = float(numpy.linalg.norm(nusc.box_velocity(box["token"])[:2]))
        for token in box["attribute_tokens"] if numpy.isfinite(speed) else []:
            speeds.setdefault(nusc.get("attribute", token)["name"], []).append(speed)
    # Names of its own splits are taken.
    split = json.loads((root / version / "splits.json").read_text())
    own = [part for part in split if part not in ("train", "val", "test")]
    assert all(get_scenes_of_split(part, nusc) == split[part] for part in own)
    return {
        "speeds": {name: [min(all_of), max(all_of)] for name, all_of in speeds.items()},
        "pictured": pictured,
        "own_splits": own,
    }


def webdataset(root):
    import webdataset

    found = {}
    for path in sorted(root.glob("*.tar")):
        for sample in webdataset.WebDataset(str(path), shardshuffle=False):
            about = json.loads(sample["json"])
            assert sample["__key__"] == f"{about['sample']:06}"
            members = sorted(name for name in sample if not name.startswith("_") and name != "json")
            assert members == sorted(cloud["file"] for cloud in about["clouds"])
            for cloud in about["clouds"]:
                data = numpy.load(io.BytesIO(sample[cloud["file"]]))
                assert len(data["x"]) == cloud["points"]
                used = {str(number) for number in numpy.unique(data["category_id"]) if number}
                assert used <= set(about["labels"]["category"])
            found.setdefault(path.name, []).append(about["sample"])
    return found


if __name__ == "__main__":
    style, folder = sys.argv[1:]
    json.dump({"kitti": kitti, "nuscenes": nuscenes, "webdataset": webdataset}[style](Path(folder)), sys.stdout)
