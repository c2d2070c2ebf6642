"""Reads bags with rosbags and the definitions that are published, and prints all messages as JSON.

usage: messages.py FILE...

Definitions are those that rosbags has of ROS 2 Jazzy; of livox_ros_driver2 they are as its msg folder says (13eb05e). Each
type in the bag must have the RIHS01 hash of its published definition, and each message must be the same bytes once it is
written again.
"""

import json
import math
import sys
import tempfile
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

LIVOX = {
    "CustomPoint": "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line\n",
    "CustomMsg": "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\n"
                 "CustomPoint[] points\n",
}


def published():
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in LIVOX.items():
        store.register(get_types_from_msg(text, f"livox_ros_driver2/msg/{name}"))
    return store


def plain(value):
    """Numbers that JSON lacks as text."""
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value) if field.name != "__msgtype__"}
    if isinstance(value, numpy.ndarray):
        value = value.tolist()
    if isinstance(value, list):
        return [plain(element) for element in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def read(path):
    store, topics, kinds = published(), {}, {}
    with tempfile.TemporaryDirectory() as folder:
        # rosbags wants this name.
        link = Path(folder) / "bag.mcap"
        link.symlink_to(Path(path).resolve())
        with open(link, "rb") as file:
            schemas = make_reader(file).get_summary().schemas.values()
        for schema in schemas:
            if schema.name not in store.types:
                continue
            own = get_typestore(Stores.EMPTY)
            own.register(get_types_from_msg(schema.data.decode(), schema.name))
            kinds[schema.name] = store.hash_rihs01(schema.name)
            assert own.hash_rihs01(schema.name) == kinds[schema.name], schema.name
        times = []
        with AnyReader([link]) as reader:
            for connection, time, data in reader.messages():
                times.append(time)
                message = None
                if connection.msgtype in store.types:
                    message = store.deserialize_cdr(data, connection.msgtype)
                    assert bytes(store.serialize_cdr(message, connection.msgtype)) == bytes(data), connection.topic
                if connection.topic == "/points":
                    message = None
                topics.setdefault(connection.topic, []).append({
                    "time": time, "type": connection.msgtype, "message": plain(message),
                    "bytes": bytes(data).hex() if connection.topic in ("/scan", "/echoes") else None,
                })
            latched = sorted(
                it.topic for it in reader.connections
                if any(service.durability.name == "TRANSIENT_LOCAL" for service in it.ext.offered_qos_profiles))
    return {"topics": topics, "hashes": kinds, "latched": latched, "in_order": times == sorted(times)}


if __name__ == "__main__":
    print(json.dumps([read(path) for path in sys.argv[1:]]))
