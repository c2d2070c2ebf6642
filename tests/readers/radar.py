"""Reads what radars record with readers that have nothing to do with echocast and prints it as JSON.

usage: radar.py KIND FILE...

The polar images of data sets are read by the rules of their development kits, in our own words: python/radar.py of Oxford
Radar RobotCar, pyboreas/utils/radar.py, and the file player of MulRan. Captures are read as TI's application report
SWRA581B says. Libraries that take long to load are loaded where they are used.
"""

import json
import sys
from pathlib import Path

import numpy


def frame(arrays):
    """A frame as arrays: complex numbers as pairs."""
    found = {}
    for name, array in arrays.items():
        array = numpy.asarray(array)
        found[name] = {"type": str(array.dtype), "shape": list(array.shape)}
        if array.dtype.kind == "c":
            array = numpy.stack([array.real, array.imag], -1)
        found[name]["values"] = array.ravel().tolist()
    return found


def read_npz(path):
    return frame(numpy.load(path))


def read_hdf5(path):
    import h5py

    with h5py.File(path) as file:
        for name, dataset in file.items():
            assert dataset.attrs["meaning"].decode(), name
            assert name in ("number", "adc") or dataset.attrs["unit"].decode(), name
        return frame({name: dataset[()] for name, dataset in file.items()})


def read_capture(path):
    """Of 4 samples in a chirp and 2 receivers: chirps x receivers x samples."""
    words = numpy.fromfile(path, "<i2").reshape(-1, 4)
    samples = (words[:, :2] + 1j * words[:, 2:]).reshape(-1, 2, 4)
    return {"real": samples.real.ravel().tolist(), "imag": samples.imag.ravel().tolist()}


def rows(path):
    """A row for each azimuth, in Oxford's layout."""
    import cv2

    raw = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    turns = raw[:, 8:10].copy().view(numpy.uint16).ravel() / 5600
    assert (numpy.diff(turns) > 0).all() and (raw[:, 10] == 255).all()
    return {
        "times": raw[:, :8].copy().view(numpy.int64).ravel().tolist(),
        "azimuths": (turns * 360).tolist(),
        "levels": raw[:, 11:].tolist(),
    }


def read_oxford(folder):
    folder = Path(folder)
    stamps = numpy.loadtxt(folder / "radar.timestamps", delimiter=" ", usecols=[0], dtype=numpy.int64, ndmin=1)
    return [{"stamp": int(stamp)} | rows(folder / "radar" / f"{stamp}.png") for stamp in stamps]


def read_boreas(folder):
    names = sorted((Path(folder) / "radar").iterdir())
    return [{"stamp": int(name.stem)} | rows(name) for name in names]


def read_mulran(folder):
    """A column for each azimuth."""
    import cv2

    folder = Path(folder) / "sensor_data"
    lines = [line.split(",") for line in (folder / "data_stamp.csv").read_text().splitlines()]
    assert all(name == "radar" for _, name in lines)
    image = lambda stamp: cv2.imread(str(folder / "radar/polar" / f"{stamp}.png"), cv2.IMREAD_GRAYSCALE)
    return [{"stamp": int(stamp), "levels": image(stamp).T.tolist()} for stamp, _ in lines]


def read_nuscenes(path):
    """With the filters that the development kit has by default."""
    from nuscenes.utils.data_classes import RadarPointCloud

    return RadarPointCloud.from_file(path).points.T.tolist()


def read_view_of_delft(path):
    rows = numpy.fromfile(path, numpy.float32).reshape(-1, 7)
    return [[None if value != value else value for value in row] for row in rows.tolist()]


RETURN = ("range", "azimuth", "elevation", "doppler_velocity", "amplitude")
DETECTION = ("range", "azimuth_angle", "elevation_angle", "range_rate", "rcs", "range_std", "range_rate_std")


def said(scan, detections):
    number = lambda value: None if value != value else float(value)
    flags = ("invalid_distance", "invalid_azimuth_std", "invalid_elevation_std", "invalid_range_rate")
    return {
        "frames": [scan.header.frame_id, detections.header.frame_id],
        "returns": [[number(getattr(it, name)) for name in RETURN] for it in scan.returns],
        "detections": [[number(getattr(it, name)) for name in DETECTION] for it in detections.detections],
        "flags": [[bool(getattr(it, name)) for name in flags] for it in detections.detections],
        "ids": [int(it.measurement_id) for it in detections.detections],
        "last": [int(it.raw_ambiguity_flag) for it in detections.detections],
    }


def read_bag(path):
    """The last messages, by two libraries."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory
    from rosbags.highlevel import AnyReader

    topics = ("/radar/scan", "/radar/detections")
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        kinds = {channel.topic: schema.name for schema, channel, _ in reader.iter_messages(topics=topics)}
        found = {channel.topic: message for _, channel, _, message in reader.iter_decoded_messages(topics=topics)}
    assert kinds == {
        "/radar/scan": "radar_msgs/msg/RadarScan",
        "/radar/detections": "continental_msgs/msg/ContinentalArs548DetectionList",
    }
    first = said(*(found[topic] for topic in topics))
    with AnyReader([Path(path)]) as reader:
        connections = [it for it in reader.connections if it.topic in topics]
        messages = reader.messages(connections)
        found = {it.topic: reader.deserialize(data, it.msgtype) for it, _, data in messages}
    assert said(*(found[topic] for topic in topics)) == first
    return first


if __name__ == "__main__":
    kind, *paths = sys.argv[1:]
    print(json.dumps([globals()[f"read_{kind}"](path) for path in paths]))
