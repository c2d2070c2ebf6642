"""The half of a benchmark that Python does: at each line of its input, scans as there, and says how long one took."""

import sys
import time

import echocast as ec

scene = ec.Scene.load(sys.argv[1])
sensor, place = ec.Sensor("velodyne_vlp32c"), scene.camera("Corner")
for line in sys.stdin:
    count = int(line)
    start = time.process_time()
    for frame in range(count):
        cloud = scene.scan(sensor, at=place, seed=7, frame=frame)
        assert len(cloud.range) > 0
    print(f"{1000 * (time.process_time() - start) / count:.6f}", flush=True)
