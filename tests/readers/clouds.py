"""Reads point clouds with readers that have nothing to do with echocast and prints them as JSON.

usage: clouds.py FORMAT FILE...

One list element per file: columns (world positions), names of the labels, and what else the file says.
"""

import csv
import json
import sys
from pathlib import Path

import h5py
import laspy
import numpy
import plyfile
import pye57
import pypcd4
from laspy import LazBackend

TABLES = ("category", "part", "material", "instance")
POSE = ("sensor_position", "sensor_orientation_xyzw")
ABOUT = [f"{table}_{what}" for table in TABLES for what in ("ids", "names")]
ABOUT += ["coordinates", "intensity_full_scale", *POSE]
POSITIONS = {"x": 0, "y": 1, "z": 2, "true_x": 0, "true_y": 1, "true_z": 2}


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
    for colour in ("red", "green", "blue"):
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
    assert (str(las.header.version), las.header.point_format.id) == ("1.4", 7)
    las_header(las)
    records = [v for v in list(las.header.vlrs) + list(las.evlrs or []) if v.user_id == "echocast"]
    assert [v.record_id for v in records] == [1]
    said = json.loads(records[0].record_data_bytes().decode("utf-8"))
    extra = {name: name for name in las.point_format.extra_dimension_names}
    for dimension in las.point_format.extra_dimensions:
        assert dimension.description, dimension.name
    columns = las_columns(las, {"time": "gps_time"} | extra)
    return {"columns": columns, "scale": las.header.scales[0]} | meaning(said)


def read_las2(path):
    las = laspy.read(path)
    assert (str(las.header.version), las.header.point_format.id) == ("1.2", 2)
    las_header(las)
    columns = las_columns(las, {"category_id": "point_source_id"})
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
