"""Reads trajectories, and adjusts strips, as surveyors do, with nothing of echocast.

usage: trajectories.py sbet FILE EPSG      prints the records of an SBET as JSON: its columns as they are, and eastings,
                                           northings and grid headings by PROJ
       trajectories.py smrmsg FILE         prints the records of a file of accuracy
       trajectories.py las FILE            prints what surveyors' programs find in a LAS file
       trajectories.py adjust FOLDER       prints the boresight angles (roll, pitch, heading, degrees) by which the strips of
                                           FOLDER (points.bin: t, x, y, z, strip; path.csv: the estimated trajectory) fit
                                           each other best, and their standard errors

The adjustment moves the points of every strip by three small angles about the axes of the carrier, such that they lie on the
planes of their neighbours in the other strips, by least squares. Trajectory errors last as long as strips do, so standard
errors are those of leaving out one strip after the other (jackknife), not of single points.
"""

import csv
import json
import sys
from pathlib import Path

import numpy


def records(path, numbers):
    data = Path(path).read_bytes()
    assert len(data) % (8 * numbers) == 0, len(data)
    return numpy.frombuffer(data, "<f8").reshape(-1, numbers)


def sbet(path, code):
    from pyproj import Proj

    rows = records(path, 17)
    projection = Proj(f"EPSG:{code}")
    longitude, latitude = numpy.degrees(rows[:, 2]), numpy.degrees(rows[:, 1])
    east, north = projection(longitude, latitude)
    factors = projection.get_factors(longitude, latitude)
    heading = numpy.degrees(rows[:, 9] - rows[:, 10]) - factors.meridian_convergence
    return {
        "bytes": Path(path).stat().st_size,
        "time": rows[:, 0].tolist(),
        "easting": east.tolist(),
        "northing": north.tolist(),
        "height": rows[:, 3].tolist(),
        "speed": numpy.hypot(rows[:, 4], rows[:, 5]).tolist(),
        "roll_deg": numpy.degrees(rows[:, 7]).tolist(),
        "pitch_deg": numpy.degrees(rows[:, 8]).tolist(),
        "grid_heading_deg": (heading % 360).tolist(),
    }


def las(path):
    import laspy

    read = laspy.read(path)
    header, crs = read.header, read.header.parse_crs()
    columns = ["x", "y", "z", "gps_time", "point_source_id", "edge_of_flight_line", "scan_direction_flag"]
    columns += ["reflectance_db", "amplitude_db", "true_x"]
    return {
        "epsg": crs.to_epsg(),
        "standard_time": bool(header.global_encoding.gps_time_type),
        "wkt": bool(header.global_encoding.wkt),
        "point_format": header.point_format.id,
        "scan_angle_deg": (numpy.asarray(read.scan_angle) * 0.006).tolist(),
    } | {name: numpy.asarray(read[name], float).tolist() for name in columns}


def adjust(folder):
    from scipy.spatial import cKDTree
    from scipy.spatial.transform import Rotation, Slerp

    points = records(folder / "points.bin", 5)
    with open(folder / "path.csv") as file:
        path = numpy.array([[float(value) for value in row.values()] for row in csv.DictReader(file)])
    time, place, strip = points[:, 0], points[:, 1:4], points[:, 4].astype(int)
    centre = numpy.stack([numpy.interp(time, path[:, 0], path[:, 1 + axis]) for axis in range(3)], -1)
    carrier = Slerp(path[:, 0], Rotation.from_quat(path[:, 4:8]))(time)
    seen = carrier.inv().apply(place - centre)
    # Roll about x ahead, pitch about -y, heading about -z.
    axes = numpy.diag([1.0, -1.0, -1.0])
    strips = numpy.unique(strip)

    def equations(angles):
        """By how much points turned by `angles` are off the planes of other strips, and what moves them, pair by pair."""
        turned = Rotation.from_rotvec(axes @ angles).apply(seen)
        place = centre + carrier.apply(turned)
        turns = numpy.stack([carrier.apply(numpy.cross(axis, turned)) for axis in axes], -1)
        found = []
        for other in strips:
            theirs = numpy.flatnonzero(strip == other)
            tree = cKDTree(place[theirs][:, :2])
            for one in strips[strips != other]:
                mine = numpy.flatnonzero(strip == one)[::8]
                apart, near = tree.query(place[mine][:, :2], k=12, distance_upper_bound=4.0)
                whole = numpy.isfinite(apart).all(axis=1)
                mine, near = mine[whole], theirs[near[whole]]
                middle = place[near].mean(axis=1)
                spread = place[near] - middle[:, None]
                values, vectors = numpy.linalg.eigh(numpy.einsum("nki,nkj->nij", spread, spread) / 12)
                normal = vectors[:, :, 0]
                # Where the neighbours lie all around, on a plane.
                good = (values[:, 1] > 0.2 * values[:, 2]) & (values[:, 0] < 0.01)
                good &= numpy.hypot(*(middle - place[mine])[:, :2].T) < 0.7
                mine, near, middle, normal = mine[good], near[good], middle[good], normal[good]
                off = numpy.einsum("ni,ni->n", normal, place[mine] - middle)
                moved = numpy.einsum("ni,nij->nj", normal, turns[mine] - turns[near].mean(axis=1))
                found.append((one, other, off, moved))
        return found

    def solved(found, without=None):
        used = [(off, moved) for one, other, off, moved in found if without not in (one, other)]
        off, moved = numpy.concatenate([a for a, _ in used]), numpy.concatenate([b for _, b in used])
        return numpy.linalg.lstsq(moved, -off, rcond=None)[0]

    angles = numpy.zeros(3)
    for _ in range(2):
        angles = angles + solved(equations(angles))
    found = equations(angles)
    left_out = numpy.stack([angles + solved(found, without=one) for one in strips])
    angles = angles + solved(found)
    count = len(strips)
    error = numpy.sqrt((count - 1) / count * ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0))
    return {"boresight_deg": numpy.degrees(angles).tolist(), "error_deg": numpy.degrees(error).tolist()}


kind, *arguments = sys.argv[1:]
if kind == "sbet":
    print(json.dumps(sbet(*arguments)))
elif kind == "smrmsg":
    print(json.dumps(records(arguments[0], 10).tolist()))
elif kind == "las":
    print(json.dumps(las(*arguments)))
else:
    print(json.dumps(adjust(Path(arguments[0]))))
