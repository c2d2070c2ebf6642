"""A simulator's loop: makes its own meshes, then for 100 frames moves a car and the sensor, scans at the sensor's rate and
reads columns. Prints how many points there were and a digest of them, the same in every language, and the processor time
of a frame.

    python examples/python/live.py
"""

import sys
import time

import numpy as np

import echocast as ec

FRAMES = 100
HOUSES = 24


def cuboid(x, y, z):
    """A box of 12 triangles from (-x, -y, 0) to (x, y, z)."""
    corners = [[x if i & 1 else -x, y if i & 2 else -y, z if i & 4 else 0] for i in range(8)]
    faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
    triangles = [[a, b, c] for a, b, c, _ in faces], [[a, c, d] for a, _, c, d in faces]
    return np.array(corners, np.float32), np.stack(triangles, axis=1).reshape(-1, 3).astype(np.uint32)


def digest(value, column):
    """64-bit FNV-1a of `value` and the bytes of a column."""
    for byte in column.tobytes():
        value = (value ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    return value


scene = ec.LiveScene()
for number, name in enumerate(["ground", "house", "car"], 1):
    scene.name_label("category", number, name)
scene.add(*cuboid(100, 100, 0.25), name="ground", pose=(0, 0, -0.25), category=1, instance=1, fixed=True)
plaster = {"name": "plaster", "reflectance": 0.5}
places = [(10 * (i // 2) - 60, 12 if i % 2 else -12, 0) for i in range(HOUSES)]
house = scene.add(
    *cuboid(4, 4, 6), name="house", pose=places[0], category=2, instance=2, material=plaster, fixed=True
)
for i in range(1, HOUSES):
    scene.add_copy(house, pose=places[i], instance=2 + i, fixed=True)
car = scene.add(*cuboid(2, 1, 1.5), name="car", category=3, instance=100, material="{name: paint, reflectance: 0.75}")

sensor = ec.Sensor("velodyne_vlp16")
period_ns = round(1e9 * sensor.period)
fields = "x,y,z,range,intensity,category_id,instance_id,time"
clouds = []
start = time.process_time()
for frame in range(FRAMES):
    if frame == 1:
        start = time.process_time()  # the first frame builds the fixed objects
    # The car drives ahead, turned by the angle of the triangle 3, 4, 5.
    pose = np.eye(4)
    pose[:2, :2] = [[0.8, -0.6], [0.6, 0.8]]
    pose[:2, 3] = 8 + 0.25 * frame, 0.0625 * frame - 3
    scene.set_pose(car, pose)

    # The sensor moves during the scan.
    times = [ns // 10**9 + ns % 10**9 * 1e-9 for ns in (frame * period_ns, (frame + 1) * period_ns)]
    path = ec.Trajectory(times, np.array([[0.125 * frame, 0, 1.75], [0.125 * (frame + 1), 0, 1.75]]))
    clouds.append(scene.scan(sensor, at=path, fields=fields, seed=7, frame=frame, start_time=times[0]))
milliseconds = 1000 * (time.process_time() - start) / (FRAMES - 1)

value = 0xCBF29CE484222325
for cloud in clouds:
    value = digest(digest(value, cloud.range), cloud.instance_id)
print(f"{FRAMES} frames: {sum(map(len, clouds))} points, digest {value:016x}")
print(f"{milliseconds:.3f} ms of processor time a frame", file=sys.stderr)
