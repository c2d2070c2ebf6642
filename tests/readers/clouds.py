"""Reads point clouds with readers that have nothing to do with echocast and prints them as JSON.

usage: clouds.py FORMAT FILE...

One list element per file: columns (world positions), names of the labels, and what else the file says.
"""

import csv
import json
import os
import re
import sys
import tempfile
from pathlib import Path

import h5py
import laspy
import numpy
import plyfile
import pye57
import pypcd4
from laspy import LazBackend
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation

TABLES = ("category", "part", "material", "instance")
POSE = ("sensor_position", "sensor_orientation_xyzw")
ABOUT = [f"{table}_{what}" for table in TABLES for what in ("ids", "names")]
ABOUT += ["coordinates", "intensity_full_scale", *POSE]
POSITIONS = {stem + axis: index for stem in ("", "true_", "corrected_") for index, axis in enumerate("xyz")}


def names(tables):
    """Name tables out of a mapping that has category_ids, category_names and so on."""
    for table in TABLES:
        assert len(tables[f"{table}_ids"]) == len(tables[f"{table}_names"])
    return {t: [[int(i), str(n)] for i, n in zip(tables[f"{t}_ids"], tables[f"{t}_names"])] for t in TABLES}


def meaning(said):
    """What a mapping says of the whole cloud; no full scale of intensities is none, or nan."""
    full = float(said.get("intensity_full_scale", numpy.nan))
    about = {name: [float(value) for value in said[name]] for name in POSE}
    about["coordinates"] = str(said["coordinates"])
    about["intensity_full_scale"] = None if numpy.isnan(full) else full
    return {"names": names(said), "about": about}


def beside(path):
    said = json.loads(Path(f"{path}.labels.json").read_text(encoding="utf-8"))
    assert "origin" not in said
    return said


def las_header(las):
    """What the header says of the points must be true of them."""
    header, number = las.header, numpy.asarray(las.return_number)
    assert header.point_count == len(las.points)
    assert header.creation_date is None
    if len(las.points):
        assert (header.mins == [las.x.min(), las.y.min(), las.z.min()]).all(), header.mins
        assert (header.maxs == [las.x.max(), las.y.max(), las.z.max()]).all(), header.maxs
    places = 15 if header.version.minor >= 4 else 5
    for i, count in enumerate(header.number_of_points_by_return[:places]):
        assert count == (number == i + 1).sum()
    assert not numpy.asarray(las.classification).any()


def las_columns(las, others):
    columns = {"x": las.x, "y": las.y, "z": las.z, "intensity": las.intensity, "return_number": las.return_number}
    columns["return_count"] = las.number_of_returns
    columns["scan_direction"] = las.scan_direction_flag
    columns["edge_of_line"] = las.edge_of_flight_line
    for colour in ("red", "green", "blue"):
        if colour not in las.point_format.dimension_names:
            continue
        wide = numpy.asarray(las[colour])
        assert (wide % 257 == 0).all()
        columns[colour] = wide // 257
    columns.update({name: las[dimension] for name, dimension in others.items()})
    return columns


def read_las(path):
    return las_of(laspy.read(path))


def read_laz(path):
    """As the C++ of LASzip reads it, and the same as by another reader."""
    las, other = (laspy.read(path, laz_backend=backend) for backend in (LazBackend.Laszip, LazBackend.Lazrs))
    assert las.header.are_points_compressed and las.points.array.tobytes() == other.points.array.tobytes()
    return las_of(las)


def read_chunks(path):
    """A LAZ file of several chunks has the points of the LAS file beside it."""
    las, laz = laspy.read(path.replace(".laz", ".las")), laspy.read(path, laz_backend=LazBackend.Laszip)
    assert las.points.array.tobytes() == laz.points.array.tobytes()
    return {"columns": {}, "points": len(laz.points)}


def las_of(las):
    coloured = "red" in las.point_format.dimension_names
    assert (str(las.header.version), las.header.point_format.id) == ("1.4", 7 if coloured else 6)
    las_header(las)
    records = [v for v in list(las.header.vlrs) + list(las.evlrs or []) if v.user_id == "echocast"]
    assert [v.record_id for v in records] == [1]
    said = json.loads(records[0].record_data_bytes().decode("utf-8"))
    extra = {name: name for name in las.point_format.extra_dimension_names}
    for dimension in las.point_format.extra_dimensions:
        assert dimension.description, dimension.name
    columns = las_columns(las, {"time": "gps_time", "strip": "point_source_id"} | extra)
    columns["scan_angle"] = numpy.radians(numpy.asarray(las.scan_angle) * 0.006)
    if "cause" in columns:
        assert (numpy.asarray(las.user_data) == numpy.asarray(columns["cause"])).all()
    if "channel" in columns and len(las.points) and (numpy.asarray(columns["channel"]) < 4).all():
        assert (numpy.asarray(las.scanner_channel) == numpy.asarray(columns["channel"])).all()
    return {"columns": columns, "scale": las.header.scales[0]} | meaning(said)


def read_las2(path):
    las = laspy.read(path)
    assert (str(las.header.version), las.header.point_format.id) == ("1.2", 2)
    las_header(las)
    columns = las_columns(las, {"category_id": "point_source_id"})
    columns["scan_angle"] = numpy.radians(numpy.asarray(las.scan_angle_rank).astype(float))
    return {"columns": columns, "scale": las.header.scales[0]} | meaning(beside(path))


def read_csv(path):
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    columns = {name: [float(row[i]) for row in rows[1:]] for i, name in enumerate(rows[0])}
    return {"columns": columns} | meaning(beside(path))


def read_ply(path):
    ply = plyfile.PlyData.read(path)
    assert not ply.text and ply.byte_order == "<"
    vertex = ply["vertex"]
    read_by_open3d = {"float", "double", "uchar", "int"}
    assert {str(p).split()[1] for p in vertex.properties} <= read_by_open3d
    renamed = {"nx": "normal_x", "ny": "normal_y", "nz": "normal_z"}
    columns = {renamed.get(p.name, p.name.removeprefix("scalar_")): vertex[p.name] for p in vertex.properties}
    grid = dict(line.split() for line in ply.obj_info)
    shape = [int(grid["num_rows"]), int(grid["num_cols"])] if grid else None
    return {"columns": columns, "shape": shape} | meaning(beside(path))


def read_pcd(path, data="binary"):
    cloud = pypcd4.PointCloud.from_path(path)
    about, rows = cloud.metadata, numpy.atleast_1d(cloud.pc_data)
    assert (about.version, about.data.value) == ("0.7", data), about
    assert about.width * about.height == about.points == len(rows)
    columns = {name: rows[name] for name in about.fields}
    if "rgb" in columns:
        rgb = columns.pop("rgb").astype(numpy.uint32)
        columns |= {name: rgb >> shift & 255 for name, shift in (("red", 16), ("green", 8), ("blue", 0))}
    shape = None if about.height == 1 else [about.height, about.width]
    return {"columns": columns, "shape": shape} | meaning(beside(path))


def read_pcd_ascii(path):
    return read_pcd(path, "ascii")


def read_pcd_compressed(path):
    return read_pcd(path, "binary_compressed")


def read_e57(path):
    """All scans together, in the world."""
    file, said = pye57.E57(path), beside(path)
    scans = [e57_scan(file, index, said["coordinates"] == "world") for index in range(file.scan_count)]
    columns = {name: numpy.concatenate([scan[name] for scan in scans]) for scan in scans[:1] for name in scan}
    grid = [columns.pop(name) for name in ("rowIndex", "columnIndex") if name in columns]
    return {"columns": columns, "shape": [int(i.max()) + 1 for i in grid] or None, "scans": len(scans)} | meaning(said)


def e57_scan(file, index, world):
    header = file.get_header(index)
    assert header.has_pose()
    # It reads returns, times and attributes of extensions as well, if they are called supported.
    for name in header.point_fields:
        pye57.e57.SUPPORTED_POINT_FIELDS.setdefault(name, "d")
    scan = file.read_scan_raw(index)
    scan = {name.removeprefix("echocast:"): numpy.asarray(column) for name, column in scan.items()}
    place = numpy.stack([scan.pop(f"cartesian{axis}") for axis in "XYZ"]).astype(float)
    miss = scan.pop("cartesianInvalidState", numpy.zeros(place.shape[1])) != 0
    if world:
        place = header.rotation_matrix @ place + header.translation[:, None]
    place[:, miss] = numpy.nan
    scan |= dict(zip("xyz", place))
    renamed = {"timeStamp": "time", "colorRed": "red", "colorGreen": "green", "colorBlue": "blue"}
    renamed |= {"returnIndex": "return_number", "returnCount": "return_count"}
    scan = {renamed.get(name, name): column for name, column in scan.items()}
    if "return_number" in scan:
        scan["return_number"] = numpy.where(miss, 0, scan["return_number"].astype(int) + 1)
    return scan


# Where drivers put what they publish: offset and PointField type, and the bytes of a point.
XYZ = {"x": (0, 7), "y": (4, 7), "z": (8, 7)}
DRIVERS = {
    "velodyne": (22, XYZ | {"intensity": (12, 7), "ring": (16, 4), "time": (18, 7)}),
    "ouster": (48, XYZ | {
        "intensity": (16, 7), "t": (20, 6), "reflectivity": (24, 4), "ring": (26, 4), "ambient": (28, 4),
        "range": (32, 6),
    }),
    "hesai": (26, XYZ | {"intensity": (12, 7), "ring": (16, 4), "timestamp": (18, 8)}),
    "robosense": (26, XYZ | {"intensity": (12, 7), "ring": (16, 4), "timestamp": (18, 8)}),
    "livox": (26, XYZ | {"intensity": (12, 7), "tag": (16, 2), "line": (17, 2), "timestamp": (18, 8)}),
    "autoware": (32, XYZ | {
        "intensity": (12, 2), "return_type": (13, 2), "channel": (14, 4), "azimuth": (16, 7), "elevation": (20, 7),
        "distance": (24, 7), "time_stamp": (28, 6),
    }),
}
# The columns without which a field of a driver is not there.
NEEDED = {"intensity", "ring", "time", "return_number", "return_count"}
POINT_TYPES = {2: "u1", 4: "<u2", 6: "<u4", 7: "<f4", 8: "<f8"}


def read_mcap(path):
    """All messages together, in the world. The name of the file says whose points they are: `mcap_ouster`."""
    told = re.match("mcap_([a-z]+)", Path(path).name)
    driver = told[1] if told else "velodyne"
    topics, later = {}, "durability: 1"
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary.chunk_indexes and all(chunk.compression == "zstd" for chunk in summary.chunk_indexes)
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert (later in channel.metadata["offered_qos_profiles"]) == (channel.topic in ("/legend", "/tf_static"))
            stamp = getattr(decoded, "header", None) and nanoseconds(decoded.header)
            assert stamp in (None, message.log_time) and message.publish_time == message.log_time
            topics.setdefault(channel.topic, []).append((schema.name, message.log_time, decoded))
        assert summary.statistics.message_count == sum(len(messages) for messages in topics.values())
    read_alike_by_rosbags(path, topics)
    ((kind, _, legend),) = topics.pop("/legend")
    assert kind == "std_msgs/msg/String"
    said = json.loads(legend.data)
    assert said.get("driver") == (told and told[1])
    poses = {time: transform_of(message) for _, time, message in topics["/tf"]}
    fixed = [it for _, _, message in topics.pop("/tf_static", []) for it in message.transforms]
    assert [optical_of(it) for it in fixed] == ["sensor_optical"] * ("/depth/image_rect" in topics)
    images = images_of(topics) if "/depth/image_rect" in topics else {}
    clouds = []
    for kind, time, message in topics["/points"]:
        assert (kind, message.header.frame_id) == ("sensor_msgs/msg/PointCloud2", "sensor")
        columns = columns_of(message, driver, time / 1e9, NEEDED <= set(said["columns"]))
        place = numpy.stack([columns[axis] for axis in "xyz"]).astype(float)
        assert message.is_dense == bool(driver != "hesai" and numpy.isfinite(place).all())
        if said["coordinates"] == "world":
            turn, shift = poses[time]
            place = turn @ place + shift[:, None]
        clouds.append(columns | dict(zip("xyz", place)))
    columns = {name: numpy.concatenate([cloud[name] for cloud in clouds]) for name in clouds[0]}
    last = topics["/points"][-1][2]
    shape = None if last.height == 1 else [sum(m.height for _, _, m in topics["/points"]), last.width]
    found = {"columns": columns, "shape": shape, "messages": {topic: len(all) for topic, all in topics.items()}}
    found["stamps"] = [time for _, time, _ in topics["/points"]]
    if "/detections" in topics:
        frame = "map" if said["coordinates"] == "world" else "sensor"
        found["boxes"] = [box_of(it, frame) for _, _, message in topics["/detections"] for it in message.detections]
    return found | images | meaning(said)


def read_points(path):
    """The messages with points, as they are."""
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = []
        for _, _, _, message in reader.iter_decoded_messages(topics=["/points"]):
            fields = [[field.name, field.offset, field.datatype] for field in message.fields]
            columns = {name: numpy.asarray(column, float) for name, column in rows_of(message).items()}
            found.append({
                "stamp": nanoseconds(message.header), "height": message.height, "width": message.width,
                "step": message.point_step, "fields": fields, "dense": message.is_dense,
                "columns": {name: [repr(value) for value in column.tolist()] for name, column in columns.items()},
            })
    return {"messages": found}


def nanoseconds(header):
    return header.stamp.sec * 10**9 + header.stamp.nanosec


def read_alike_by_rosbags(path, topics):
    """It wants another file name."""
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / "bag.mcap"
        os.symlink(Path(path).resolve(), link)
        found = {}
        with AnyReader([link]) as reader:
            (legend,) = (it for it in reader.connections if it.topic == "/legend")
            assert [service.durability.name for service in legend.ext.offered_qos_profiles] == ["TRANSIENT_LOCAL"]
            for connection, time, data in reader.messages():
                message = reader.deserialize(data, connection.msgtype)
                found.setdefault(connection.topic, []).append((connection.msgtype, time, message))
        assert found.keys() == topics.keys()
        for topic, messages in topics.items():
            assert len(messages) == len(found[topic])
            for (kind, time, a), (other_kind, other_time, b) in zip(messages, found[topic]):
                assert (kind, time) == (other_kind, other_time) and alike(a, b), topic


def alike(a, b):
    """Whether two libraries' messages say the same."""
    if hasattr(a, "__slots__"):
        return all(alike(getattr(a, name), getattr(b, name)) for name in a.__slots__)
    if isinstance(a, (bytes, bytearray, list, numpy.ndarray)) and not (len(a) and hasattr(a[0], "__slots__")):
        flat = numpy.frombuffer(a, numpy.uint8) if isinstance(a, (bytes, bytearray)) else numpy.asarray(a)
        return numpy.array_equal(flat, numpy.asarray(b))
    if isinstance(a, list):
        return len(a) == len(b) and all(map(alike, a, b))
    return a == b or a != a and b != b


def transform_of(message):
    """Rotation matrix and translation."""
    (stamped,) = message.transforms
    assert (stamped.header.frame_id, stamped.child_frame_id) == ("map", "sensor")
    q, t = stamped.transform.rotation, stamped.transform.translation
    return Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix(), numpy.array([t.x, t.y, t.z])


def optical_of(stamped):
    """The frame of images: z ahead, x to the right."""
    q = stamped.transform.rotation
    axes = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
    assert stamped.header.frame_id == "sensor" and numpy.allclose(axes, [[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    return stamped.child_frame_id


def images_of(topics):
    """The last images of a camera, as lists of pixels, and where pixels with a depth are in the sensor frame."""
    info, depth, points = (topics[name][-1][2] for name in ("/depth/camera_info", "/depth/image_rect", "/points"))
    labels = topics["/labels/image_rect"][-1][2] if "/labels/image_rect" in topics else None
    assert (depth.encoding, depth.step, depth.header.frame_id) == ("32FC1", 4 * depth.width, "sensor_optical")
    assert (info.height, info.width) == (depth.height, depth.width) == (points.height, points.width)
    assert info.distortion_model == "plumb_bob" and list(info.d) == [0] * 5 and list(info.p)[:3] == list(info.k)[:3]
    z = numpy.frombuffer(bytes(depth.data), "<f4").astype(float)
    found = {"depth": [repr(value) for value in z.tolist()]}
    fx, _, cx, _, fy, cy, *_ = info.k
    row, column = numpy.divmod(numpy.arange(len(z)), info.width)
    places = [z, -(column - cx) / fx * z, -(row - cy) / fy * z]
    found["unprojected"] = [[repr(value) for value in axis.tolist()] for axis in places]
    if labels:
        assert (labels.encoding, labels.step) == ("16UC1", 2 * labels.width)
        found["labels"] = numpy.frombuffer(bytes(labels.data), "<u2").tolist()
    return found


def rows_of(message):
    """The numbers of a PointCloud2 by the names that they have there."""
    fields = [(field.name, POINT_TYPES[field.datatype], field.offset) for field in message.fields]
    names, formats, offsets = zip(*fields)
    kind = {"names": names, "formats": formats, "offsets": offsets, "itemsize": message.point_step}
    rows = numpy.frombuffer(bytes(message.data), numpy.dtype(kind))
    assert len(rows) == message.width * message.height
    return {name: rows[name] for name in names}


def columns_of(message, driver, start, is_whole):
    """The columns of a PointCloud2, called as echocast calls them, times in s of the run."""
    step, known = DRIVERS[driver]
    for field in message.fields:
        place = (field.offset, field.datatype)
        assert field.count == 1 and known.get(field.name, place) == place and (field.name in known or place[0] >= step)
    assert not message.is_bigendian and message.row_step == message.width * message.point_step
    columns = rows_of(message)
    assert not is_whole or known.keys() <= columns.keys()
    if "rgb" in columns:
        rgb = columns.pop("rgb").view(numpy.uint32)
        columns |= {name: rgb >> shift & 255 for name, shift in (("red", 16), ("green", 8), ("blue", 0))}
    renamed = {"line": "ring", "t": "time", "timestamp": "time"}
    if driver == "autoware":
        renamed = {"channel": "ring", "laser_id": "channel", "distance": "range", "time_stamp": "time"}
        assert (columns.pop("return_type", numpy.zeros(1)) <= 7).all()
    columns = {renamed.get(name, name): column for name, column in columns.items()}
    if "time" in columns:
        time = columns["time"].astype(float)
        since = {"velodyne": start + time, "ouster": start + time / 1e9, "livox": time / 1e9}
        columns["time"] = (since | {"autoware": since["ouster"]}).get(driver, time)
    if driver == "autoware" and "intensity" in columns:
        columns["intensity"] = columns["intensity"] / 255
    if driver == "ouster":
        assert not columns.pop("ambient").any()
        if "range" in columns:
            columns["range"] = numpy.where(columns["range"] == 0, numpy.nan, columns["range"] / 1000)
        if "reflectivity" in columns:
            reflectivity, intensity = columns.pop("reflectivity"), numpy.nan_to_num(columns["intensity"])
            assert (abs(reflectivity - intensity.astype(float) * 255) <= 0.5).all()
    if "tag" in columns:
        assert (columns.pop("tag") == numpy.minimum(columns["return_number"], 3) << 4).all()
    return columns


def box_of(detection, frame):
    (result,) = detection.results
    center, size = detection.bbox.center, detection.bbox.size
    assert detection.header.frame_id == frame and result.hypothesis.score == 1.0
    assert result.pose.pose.position.x == center.position.x and not any(result.pose.covariance)
    return {
        "time": nanoseconds(detection.header) / 1e9,
        "track_id": int(detection.id),
        "category": result.hypothesis.class_id,
        "position": [getattr(center.position, axis) for axis in "xyz"],
        "size": [getattr(size, axis) for axis in "xyz"],
        "orientation_xyzw": [getattr(center.orientation, axis) for axis in "xyzw"],
    }


def from_arrays(arrays):
    """A mapping of arrays whose positions are relative to `origin`."""
    arrays = dict(arrays)
    boxes = {name.removeprefix("boxes/"): arrays.pop(name) for name in list(arrays) if name.startswith("boxes/")}
    said = {name: arrays.pop(name) for name in ABOUT}
    origin, shape = arrays.pop("origin"), arrays.pop("shape", None)
    for name, axis in POSITIONS.items():
        if name in arrays:
            assert arrays[name].dtype == numpy.float32
            arrays[name] = arrays[name].astype(float) + origin[axis]
    return {"columns": arrays, "shape": None if shape is None else shape.tolist()} | about_boxes(boxes) | meaning(said)


def about_boxes(columns):
    """Columns of boxes as a list of boxes; nothing if there are none."""
    if not columns:
        return {}
    for name, column in columns.items():
        kind = numpy.float64 if column.ndim == 2 or name in ("time", "visible") else numpy.uint32
        assert column.dtype == kind, name
    (count,) = {len(column) for column in columns.values()}
    return {"boxes": [{name: column[i].tolist() for name, column in columns.items()} for i in range(count)]}


def read_npz(path):
    with numpy.load(path) as file:
        return from_arrays(file)


def whole(dataset):
    return (dataset.asstr() if h5py.check_string_dtype(dataset.dtype) else dataset)[()]


def read_hdf5(path):
    with h5py.File(path) as file:
        datasets = with_boxes(file)
        for name, dataset in datasets.items():
            other = name in ABOUT or name in ("origin", "shape")
            assert other or ({"unit", "meaning"} == set(dataset.attrs) and dataset.attrs["meaning"]), name
        return from_arrays({name: whole(dataset) for name, dataset in datasets.items()})


def with_boxes(file):
    """All datasets, those of the group `boxes` under the names that NPZ has for them."""
    datasets = dict(file.items())
    boxes = datasets.pop("boxes", {})
    return datasets | {f"boxes/{name}": dataset for name, dataset in boxes.items()}


def read_frames(path):
    """A file of frames: one result per frame."""
    with h5py.File(path) as file:
        datasets = with_boxes(file)
        boxes = {k.removeprefix("boxes/"): whole(datasets.pop(k)) for k in list(datasets) if k.startswith("boxes/")}
        columns = {k: d for k, d in datasets.items() if k not in ABOUT and h5py.check_vlen_dtype(d.dtype)}
        assert all(d.attrs["meaning"] for d in columns.values())
        rows = columns | {k: file[k] for k in POSE}
        common = {k: whole(d) for k, d in datasets.items() if k not in rows}
        count = {len(d) for d in rows.values()}
        assert len(count) == 1
        frames = [plain(from_arrays({k: d[i] for k, d in rows.items()} | common)) for i in range(*count)]
        return {"frames": frames} | about_boxes(boxes)


def read_boxes(path):
    """A file of boxes, JSON or CSV, as one list; cells of a CSV as text."""
    if str(path).endswith(".json"):
        return {"boxes": json.loads(Path(path).read_text(encoding="utf-8"))}
    with open(path, newline="", encoding="utf-8") as file:
        return {"boxes": list(csv.DictReader(file))}


def plain(result):
    """Numbers as text, which keeps every bit and nan."""
    columns = result.get("columns", {})
    for name, column in columns.items():
        column = numpy.asarray(column, dtype=float)
        assert column.ndim == 1 and not numpy.isinf(column).any()
        columns[name] = [repr(value) for value in column.tolist()]
    return result


reader = globals()[f"read_{sys.argv[1]}"]
json.dump([plain(reader(path)) for path in sys.argv[2:]], sys.stdout)
