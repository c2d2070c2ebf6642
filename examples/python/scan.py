"""Loads the hall, scans it with a Velodyne VLP-16, writes a LAS file, and prints how many points there are and a digest of
them, the same in every language.

    python examples/python/scan.py examples/scenes/indoor-1.glb hall.las
"""

import sys

import echocast as ec


def digest(cloud):
    """64-bit FNV-1a of the bytes of all columns, one after the other in the order of the table of columns."""
    value = 0xCBF29CE484222325
    for byte in b"".join(cloud[field].tobytes() for field in cloud.fields):
        value = (value ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    return value


scene_path, path = sys.argv[1:] or ("examples/scenes/indoor-1.glb", "hall.las")
cloud = ec.Scene.load(scene_path).scan("velodyne_vlp16", at=(-6, 6, 1.2), seed=7)
cloud.write(path)
print(f"{path}: {len(cloud)} points, digest {digest(cloud):016x}")
