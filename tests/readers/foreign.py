"""Writes point clouds with writers that have nothing to do with echocast and prints what they hold as JSON.

usage: foreign.py FOLDER

For each file: columns (world positions), and what else a reader should find or say.
"""

import json
import struct
import sys
from pathlib import Path

import h5py
import laspy
import numpy
import plyfile
import pye57
import pypcd4
from laspy import LazBackend

folder = Path(sys.argv[1])
random = numpy.random.default_rng(1)
COUNT = 1000
found = {}


def told(name, columns, tolerance=None, **others):
    columns = {name: [repr(value) for value in numpy.asarray(column, dtype=float).tolist()] for name, column in columns.items()}
    found[name_of(name)] = {"columns": columns, "tolerance": tolerance or {}} | others


def name_of(path):
    return Path(path).name


def write_las(name, version, number, backend=None, far=(0, 0, 0), scale=0.001, extra=()):
    header = laspy.LasHeader(version=version, point_format=number)
    header.scales, header.offsets = [scale] * 3, list(far)
    for parameters in extra:
        header.add_extra_dim(parameters)
    las = laspy.LasData(header)
    for axis, start in zip("xyz", far):
        las[axis] = start + random.uniform(-400, 400, COUNT)
    wide = number >= 6
    las.intensity = random.integers(0, 65536, COUNT)
    las.return_number = random.integers(1, 6, COUNT)
    las.number_of_returns = random.integers(5, 8, COUNT)
    las.classification = random.integers(0, 23 if wide else 13, COUNT)
    las.user_data = random.integers(0, 256, COUNT)
    lost = ["user_data"]
    las.scan_direction_flag = random.integers(0, 2, COUNT)
    las.edge_of_flight_line = random.integers(0, 2, COUNT)
    las.point_source_id = random.integers(0, 65536, COUNT)
    if wide:
        las.scan_angle = random.integers(-30000, 30001, COUNT)
        las.scanner_channel = random.integers(0, 4, COUNT)
    else:
        las.scan_angle_rank = random.integers(-90, 91, COUNT)
    columns = {axis: numpy.asarray(las[axis]) for axis in "xyz"}
    columns["intensity"] = numpy.asarray(las.intensity) / 65535
    columns |= {"return_number": las.return_number, "return_count": las.number_of_returns}
    columns |= {"scan_direction": las.scan_direction_flag, "edge_of_line": las.edge_of_flight_line}
    columns |= {"strip": las.point_source_id}
    degrees = numpy.asarray(las.scan_angle) * 0.006 if wide else numpy.asarray(las.scan_angle_rank).astype(float)
    columns["scan_angle"] = numpy.radians(degrees)
    if wide:
        columns["channel"] = las.scanner_channel
    if not extra:
        columns["category_id"] = las.classification
    if "gps_time" in las.point_format.dimension_names:
        las.gps_time = random.uniform(0, 1e9, COUNT)
        columns["time"] = las.gps_time
    if "red" in las.point_format.dimension_names:
        for colour in ("red", "green", "blue"):
            las[colour] = random.integers(0, 65536, COUNT)
            columns[colour] = numpy.floor(numpy.asarray(las[colour]) / 257 + 0.5)
    if "nir" in las.point_format.dimension_names:
        las.nir = random.integers(0, 65536, COUNT)
        lost.append("nir")
    for parameters in extra:
        if parameters.scales is None:
            las[parameters.name] = random.integers(0, 200, COUNT)
        else:
            las[parameters.name] = random.uniform(0, 20, COUNT)
    if extra:
        columns |= {"category_id": las["label"], "range": las["Range"]}
        lost.append("temperature")
    las.write(folder / name, laz_backend=backend)
    names = {} if extra else {"2": "ground", "6": "building"}
    tolerance = dict.fromkeys("xyz", 1e-4) | {"intensity": 1e-7, "range": 1e-6, "scan_angle": 1e-6}
    told(name, columns, tolerance, lost=lost, categories=names)


for number in range(11):
    version = "1.4" if number >= 6 else "1.3" if number >= 4 else "1.2"
    write_las(f"format {number}.las", version, number)
    # What has waveforms is not compressed by either.
    if number not in (4, 5, 9, 10):
        write_las(f"format {number}.laz", version, number, LazBackend.Laszip)
write_las("parallel.laz", "1.4", 7, LazBackend.LazrsParallel)
write_las("old.las", "1.1", 1)
write_las("far.las", "1.2", 3, far=(500000, 5600000, 0), scale=0.01)
dimensions = [
    laspy.ExtraBytesParams("label", "uint8"),
    laspy.ExtraBytesParams("Range", "int32", scales=[0.001], offsets=[1.0]),
    laspy.ExtraBytesParams("temperature", "float32"),
]
write_las("extra.las", "1.4", 6, extra=dimensions)
write_las("extra.laz", "1.4", 6, LazBackend.Laszip, extra=dimensions)


def plain_las():
    """Colours of eight bits, no intensities and no times; an offset far from the points."""
    las = laspy.LasData(laspy.LasHeader(version="1.2", point_format=3))
    las.header.offsets, las.header.scales = [0, 0, 0], [0.01] * 3
    las.x, las.y = 500000 + random.uniform(0, 90, COUNT), 5600000 + random.uniform(0, 90, COUNT)
    las.z = random.uniform(0, 90, COUNT)
    columns = {axis: numpy.asarray(las[axis]) for axis in "xyz"}
    for colour in ("red", "green", "blue"):
        las[colour] = random.integers(0, 256, COUNT)
        columns[colour] = las[colour]
    las.write(folder / "plain.las")
    told("plain.las", columns, dict.fromkeys("xyz", 1e-4))


plain_las()


def write_ply(name, text=False, order="<"):
    fields = [("x", "f8"), ("y", "f8"), ("z", "f8"), ("nx", "f4"), ("red", "u1"), ("green", "u1"), ("blue", "u1")]
    fields += [("scalar_Intensity", "f4"), ("scalar_Classification", "f4"), ("ring", "u2"), ("confidence", "f4")]
    vertices = numpy.empty(COUNT, fields)
    for field, kind in fields:
        vertices[field] = random.integers(0, 256, COUNT) if kind == "u1" else random.uniform(0, 99, COUNT)
    vertices["scalar_Classification"] = random.integers(0, 20, COUNT)
    element = plyfile.PlyElement.describe(vertices, "vertex")
    plyfile.PlyData([element], text=text, byte_order=order).write(folder / name)
    renamed = {"nx": "normal_x", "scalar_Intensity": "intensity", "scalar_Classification": "category_id"}
    columns = {renamed.get(f, f): vertices[f] for f, _ in fields if f != "confidence"}
    told(name, columns, dict.fromkeys("xyz", 1e-5), lost=["confidence"])


def listed_ply(name, text=False, order="<"):
    """Vertices with lists of the cameras that see them, as Meshroom and MVE have them, and no faces."""
    vertices = numpy.empty(COUNT, [("x", "f4"), ("y", "f4"), ("view", object), ("z", "f4"), ("quality", "u1")])
    for axis in "xyz":
        vertices[axis] = random.uniform(-9, 9, COUNT)
    vertices["quality"] = random.integers(0, 100, COUNT)
    vertices["view"] = [numpy.arange(random.integers(0, 5), dtype="i4") for _ in range(COUNT)]
    element = plyfile.PlyElement.describe(vertices, "vertex", val_types={"view": "i4"}, len_types={"view": "u1"})
    plyfile.PlyData([element], text=text, byte_order=order).write(folder / name)
    columns = {field: vertices[field].astype(float) for field in ("x", "y", "z", "quality")}
    told(name, columns, dict.fromkeys("xyz", 1e-5), lost=["view[]"])


listed_ply("listed text.ply", text=True, order="=")
listed_ply("listed little.ply")
write_ply("text.ply", text=True, order="=")
write_ply("little.ply")
write_ply("big.ply", order=">")


def write_pcd(name, encoding):
    fields = ("x", "y", "z", "intensity", "ring", "rgb", "curvature")
    rgb = random.integers(0, 1 << 24, COUNT).astype(numpy.uint32)
    # Whole numbers, or nothing would become smaller.
    arrays = [random.integers(-50, 50, COUNT).astype(numpy.float32) for _ in range(3)]
    arrays += [random.uniform(0, 255, COUNT).astype(numpy.float32), random.integers(0, 128, COUNT).astype(numpy.uint16)]
    arrays += [rgb.view(numpy.float32), arrays[0]]
    types = (numpy.float32,) * 4 + (numpy.uint16,) + (numpy.float32,) * 2
    points = numpy.rec.fromarrays(arrays, dtype=list(zip(fields, types)))
    cloud = pypcd4.PointCloud.from_points(arrays, fields, types)
    cloud.pc_data = points
    cloud.metadata.viewpoint = (1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0)
    cloud.save(folder / name, encoding=encoding)
    assert f"DATA {encoding.value}\n".encode() in (folder / name).read_bytes()
    columns = dict(zip(("x", "y", "z", "intensity", "ring"), arrays))
    columns |= {"red": rgb >> 16, "green": rgb >> 8 & 255, "blue": rgb & 255}
    # Text has ten digits behind the point, which is not all of an rgb that is a tiny number.
    if encoding == pypcd4.Encoding.ASCII:
        told(name, columns, dict.fromkeys("xyz", 1e-5) | {"intensity": 1e-4, "red": 255, "green": 255, "blue": 255},
             lost=["curvature"], sensor=[1, 2, 3])
    else:
        told(name, columns, lost=["curvature"], sensor=[1, 2, 3])


write_pcd("text.pcd", pypcd4.Encoding.ASCII)
write_pcd("binary.pcd", pypcd4.Encoding.BINARY)
write_pcd("compressed.pcd", pypcd4.Encoding.BINARY_COMPRESSED)


def padded_pcd():
    """As the Point Cloud Library has it: filling, several numbers in a field, a grid of rows and columns, NaN."""
    header = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z _ rgba fpfh\nSIZE 4 4 4 1 4 4\nTYPE F F F U U F\nCOUNT 1 1 1 4 1 33\n"
    header += "WIDTH 3\nHEIGHT 2\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 6\nDATA binary\n"
    places = numpy.arange(18, dtype=numpy.float32).reshape(6, 3)
    places[2] = numpy.nan
    body = b"".join(struct.pack("<3f4xI33f", *place, 0xFF102030, *range(33)) for place in places)
    (folder / "padded.pcd").write_bytes(header.encode() + body)
    columns = dict(zip("xyz", places.T)) | {"red": [16] * 6, "green": [32] * 6, "blue": [48] * 6}
    told("padded.pcd", columns, lost=["fpfh"], shape=[2, 3])


padded_pcd()


def write_e57():
    file = pye57.E57(str(folder / "two scans.e57"), mode="w")
    all_places, intensities, colours = [], [], []
    for turn in (0.0, 1.0):
        places = random.uniform(-20, 20, (3, COUNT))
        rotation = numpy.array([numpy.cos(turn / 2), 0, 0, numpy.sin(turn / 2)])
        translation = numpy.array([500000 + 10 * turn, 5600000, 3.0])
        intensity = random.uniform(0, 1, COUNT)
        red = random.integers(0, 256, COUNT).astype(numpy.uint8)
        scan = {f"cartesian{axis}": column for axis, column in zip("XYZ", places)} | {"intensity": intensity}
        scan |= {f"color{colour}": red for colour in ("Red", "Green", "Blue")}
        file.write_scan_raw(scan, rotation=rotation, translation=translation)
        turned = numpy.array([[numpy.cos(turn), -numpy.sin(turn), 0], [numpy.sin(turn), numpy.cos(turn), 0], [0, 0, 1]])
        all_places.append(turned @ places + translation[:, None])
        intensities.append(intensity)
        colours.append(red)
    file.close()
    columns = dict(zip("xyz", numpy.concatenate(all_places, axis=1))) | {"intensity": numpy.concatenate(intensities)}
    columns |= dict.fromkeys(("red", "green", "blue"), numpy.concatenate(colours))
    told("two scans.e57", columns, dict.fromkeys("xyz", 1e-5) | {"intensity": 1e-6}, sensor=[500000, 5600000, 3])


write_e57()


def write_npz():
    places = random.uniform(-20, 20, (3, COUNT))
    columns = dict(zip("xyz", places)) | {"category_id": random.integers(0, 9, COUNT)}
    numpy.savez_compressed(folder / "packed.npz", **columns, weight=places[0])
    told("packed.npz", columns, dict.fromkeys("xyz", 1e-5), lost=["weight"])


write_npz()


def write_hdf5(name, kind, **options):
    places = random.uniform(-20, 20, (3, COUNT))
    columns = dict(zip("xyz", places)) | {"category_id": random.integers(0, 3, COUNT)}
    with h5py.File(folder / name, "w") as file:
        for column, values in columns.items():
            file[column] = values
        file["category_ids"] = numpy.array([1, 2], dtype="u4")
        names = [name.encode() for name in ("Tür", "wall")]
        file.create_dataset("category_names", data=names, dtype=kind, **options)
    told(name, columns, dict.fromkeys("xyz", 1e-5), categories={"1": "Tür", "2": "wall"})


write_hdf5("variable.h5", h5py.string_dtype())
write_hdf5("fixed.h5", h5py.string_dtype("utf-8", 10))
write_hdf5("packed.h5", h5py.string_dtype("utf-8", 10), compression="gzip")


def write_text():
    places = random.uniform(-20, 20, (COUNT, 3))
    rows = [f"{x:.6f} {y:.6f} {z:.6f} {i % 7}" for i, (x, y, z) in enumerate(places)]
    (folder / "cloudcompare.csv").write_text("//X Y Z Classification\n".replace("X Y Z", "x y z") + "\n".join(rows) + "\n")
    columns = dict(zip("xyz", places.T)) | {"category_id": numpy.arange(COUNT) % 7}
    told("cloudcompare.csv", columns, dict.fromkeys("xyz", 1e-5))


write_text()


def write_bag(name):
    """Two clouds of a lidar on a vehicle that drives along x, looking to the left; its transforms come at other times."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    Time = types["builtin_interfaces/msg/Time"]
    Header = types["std_msgs/msg/Header"]
    Vector, Quaternion = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    Transform, Stamped = types["geometry_msgs/msg/Transform"], types["geometry_msgs/msg/TransformStamped"]
    TFMessage, Field = types["tf2_msgs/msg/TFMessage"], types["sensor_msgs/msg/PointField"]
    PointCloud2, String = types["sensor_msgs/msg/PointCloud2"], types["std_msgs/msg/String"]

    def header(nanoseconds, frame):
        return Header(Time(nanoseconds // 10**9, nanoseconds % 10**9), frame)

    def transform(nanoseconds, parent, child, place, turn):
        pose = Transform(Vector(*place), Quaternion(*turn))
        return TFMessage([Stamped(header(nanoseconds, parent), child, pose)])

    start = 1_700_000_000 * 10**9
    record = numpy.dtype({
        "names": ["x", "y", "z", "intensity", "ring", "time", "flags", "rgb"],
        "formats": ["f4", "f4", "f4", "f4", "u2", "f4", "u1", "u4"],
        "offsets": [0, 4, 8, 16, 20, 24, 28, 32],
        "itemsize": 48,
    })
    kinds = {"f4": 7, "u2": 4, "u1": 2, "u4": 6}
    formats = ["f4", "f4", "f4", "f4", "u2", "f4", "u1", "u4"]
    fields = [Field(n, record.fields[n][1], kinds[f], 1) for n, f in zip(record.names, formats)]
    columns = {name: [] for name in ("x", "y", "z", "intensity", "ring", "time", "red", "green", "blue")}
    writer = Writer(folder / (name + ".bag"), version=9, storage_plugin=StoragePlugin.MCAP)
    writer.open()
    add = {}
    for topic, kind in [("/lidar", PointCloud2), ("/tf", TFMessage), ("/tf_static", TFMessage), ("/chatter", String)]:
        connection = writer.add_connection(topic, kind.__msgtype__, typestore=store)
        add[topic] = lambda at, message, connection=connection: writer.write(
            connection, at, store.serialize_cdr(message, message.__msgtype__)
        )
    half = numpy.sqrt(0.5)
    add["/tf_static"](start, transform(start, "vehicle", "lidar", (1, 0, 2), (0, 0, half, half)))
    add["/chatter"](start, String("nothing to see"))
    for scan in range(2):
        at = start + scan * 100_000_000
        points = numpy.zeros(COUNT, record)
        for axis in "xyz":
            points[axis] = random.uniform(-20, 20, COUNT)
        points["intensity"] = random.uniform(0, 255, COUNT)
        points["ring"] = random.integers(0, 16, COUNT)
        points["time"] = numpy.linspace(0, 0.1, COUNT)
        points["rgb"] = random.integers(0, 1 << 24, COUNT)
        data = numpy.frombuffer(points.tobytes(), numpy.uint8)
        cloud = PointCloud2(header(at, "lidar"), 1, COUNT, fields, False, 48, 48 * COUNT, data, True)
        add["/lidar"](at + 100_000_000, cloud)
        # 5 m/s; the key before and the key after the cloud are 50 ms away, and the last one comes late.
        for shift in (-50_000_000, 50_000_000):
            then = at + shift
            place = (100 + 5 * (then - start) / 1e9, 50, 0)
            add["/tf"](at + 150_000_000, transform(then, "map", "vehicle", place, (0, 0, 0, 1)))
        # The lidar looks to the left of the vehicle.
        columns["x"].append(100 + 0.5 * scan + 1 - points["y"].astype(float))
        columns["y"].append(50 + points["x"].astype(float))
        columns["z"].append(2 + points["z"].astype(float))
        columns["intensity"].append(points["intensity"])
        columns["ring"].append(points["ring"])
        columns["time"].append(at / 1e9 + points["time"].astype(float))
        for colour, shift in (("red", 16), ("green", 8), ("blue", 0)):
            columns[colour].append(points["rgb"] >> shift & 255)
    writer.close()
    (made,) = (folder / (name + ".bag")).glob("*.mcap")
    made.rename(folder / name)
    columns = {name: numpy.concatenate(values) for name, values in columns.items()}
    told(name, columns, dict.fromkeys("xyz", 1e-5) | {"time": 1e-6}, lost=["flags", "topics /chatter"], sensor=[101, 50, 2])


def write_driver_bag(name, fields, step, shape, make, columns, lost, dense=True):
    """A cloud of a driver, without transforms: `fields` are name, offset and NumPy type."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    Time, Header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    Field, PointCloud2 = types["sensor_msgs/msg/PointField"], types["sensor_msgs/msg/PointCloud2"]
    kinds = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
    names, offsets, formats = zip(*fields)
    record = numpy.dtype({"names": names, "offsets": offsets, "formats": formats, "itemsize": step})
    height, width = shape
    points = numpy.zeros(height * width, record)
    for axis in "xyz":
        points[axis] = random.uniform(-20, 20, len(points))
    make(points)
    listed = [Field(field, offset, kinds[kind], 1) for field, offset, kind in fields]
    data = numpy.frombuffer(points.tobytes(), numpy.uint8)
    header = Header(Time(1_700_000_000, 250_000_000), "lidar")
    cloud = PointCloud2(header, height, width, listed, False, step, step * width, data, dense)
    writer = Writer(folder / (name + ".bag"), version=9, storage_plugin=StoragePlugin.MCAP)
    writer.open()
    connection = writer.add_connection("/points_raw", PointCloud2.__msgtype__, typestore=store)
    writer.write(connection, 1, store.serialize_cdr(cloud, PointCloud2.__msgtype__))
    writer.close()
    (made,) = (folder / (name + ".bag")).glob("*.mcap")
    made.rename(folder / name)
    columns = {axis: points[axis] for axis in "xyz"} | columns(points)
    # Drivers that have the lasers side by side are read laser by laser.
    turned = name.startswith(("velodyne", "robosense"))
    if turned:
        columns = {column: numpy.asarray(of).reshape(shape).T.ravel() for column, of in columns.items()}
    shaped = {"shape": [width, height] if turned else [height, width]} if height > 1 else {}
    if lost:
        shaped["lost"] = lost
    told(name, columns, {"time": 1e-6, "intensity": 1e-4, "range": 1e-6}, **shaped)


XYZ = [("x", 0, "f4"), ("y", 4, "f4"), ("z", 8, "f4")]
STAMP = 1_700_000_000.25


def velodyne(points):
    """Eight firings of sixteen lasers, some without a return, times before the stamp."""
    points["intensity"], points["ring"] = random.integers(0, 256, 128), numpy.tile(numpy.arange(16), 8)
    points["time"] = -0.1 + numpy.repeat(numpy.arange(8), 16) * 1e-4
    for name in ("x", "y", "z", "intensity"):
        points[name][5:9] = numpy.nan


def ouster(points):
    points["intensity"], points["reflectivity"] = random.integers(0, 4000, 128), random.integers(0, 256, 128)
    points["t"], points["ring"] = numpy.tile(numpy.arange(8) * 97_656, 16), numpy.repeat(numpy.arange(16), 8)
    points["ambient"], points["range"] = 7, random.integers(0, 120_000, 128)


def timed(unit):
    def make(points):
        points["intensity"] = random.integers(0, 256, len(points))
        points["timestamp"] = (STAMP + numpy.arange(len(points)) * 1e-4) * unit
        for name in ("ring", "line"):
            if name in points.dtype.names:
                points[name] = numpy.arange(len(points)) % 16
    return make


def autoware(points):
    points["intensity"], points["return_type"] = random.integers(0, 256, 128), 1
    points["channel"], points["time_stamp"] = numpy.arange(128), numpy.arange(128) * 1000
    for name in ("azimuth", "elevation", "distance"):
        points[name] = random.uniform(0, 1, 128)


def columns_of(ring, time):
    return lambda points: {"intensity": points["intensity"], "ring": points[ring], "time": time(points)}


RING = XYZ + [("intensity", 12, "f4"), ("ring", 16, "u2")]
write_driver_bag("velodyne.mcap", RING + [("time", 18, "f4")], 22, (8, 16), velodyne,
                 columns_of("ring", lambda p: STAMP + p["time"].astype(float)), None, dense=False)
write_driver_bag("hesai.mcap", RING + [("timestamp", 18, "f8")], 26, (1, 128), timed(1),
                 columns_of("ring", lambda p: p["timestamp"]), None, dense=False)
write_driver_bag("robosense.mcap", RING + [("timestamp", 18, "f8")], 26, (8, 16), timed(1),
                 columns_of("ring", lambda p: p["timestamp"]), None, dense=False)
write_driver_bag("livox.mcap", XYZ + [("intensity", 12, "f4"), ("tag", 16, "u1"), ("line", 17, "u1"), ("timestamp", 18, "f8")],
                 26, (1, 128), timed(1e9), columns_of("line", lambda p: p["timestamp"] / 1e9), ["tag"])
write_driver_bag("ouster.mcap", XYZ + [("intensity", 16, "f4"), ("t", 20, "u4"), ("reflectivity", 24, "u2"),
                                       ("ring", 26, "u2"), ("ambient", 28, "u2"), ("range", 32, "u4")],
                 48, (16, 8), ouster,
                 lambda p: columns_of("ring", lambda p: STAMP + p["t"] * 1e-9)(p) | {"range": (p["range"] * 1e-3).astype("f4")},
                 ["reflectivity", "ambient"])
write_driver_bag("autoware.mcap", XYZ + [("intensity", 12, "u1"), ("return_type", 13, "u1"), ("channel", 14, "u2"),
                                         ("azimuth", 16, "f4"), ("elevation", 20, "f4"), ("distance", 24, "f4"),
                                         ("time_stamp", 28, "u4")],
                 32, (1, 128), autoware,
                 lambda p: columns_of("channel", lambda p: STAMP + p["time_stamp"] * 1e-9)(p)
                 | {"azimuth": p["azimuth"], "elevation": p["elevation"], "range": p["distance"]}, ["return_type"])

write_bag("drive.mcap")
json.dump(found, sys.stdout)
