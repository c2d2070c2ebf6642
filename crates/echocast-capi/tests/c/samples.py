"""Makes all samples of a scenario and writes what is in them, as `samples.c` does.

argv: a folder for files, the scenario, the threads.
"""

import json
import sys
from pathlib import Path

import echocast as ec

folder, scenario, threads = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])
for sample in ec.Scenario(scenario, threads=threads):
    (folder / f"{sample.number}.json").write_text(json.dumps(sample.drawn))
    for scan, name in enumerate(sample.sensors):
        for frame in range(len(sample.frames(scan))):
            cloud = sample.cloud(scan, frame)
            stem = folder / f"{sample.number}_{name}_{frame}"
            stem.with_suffix(".columns").write_bytes(b"".join(cloud[field].tobytes() for field in cloud.fields))
            cloud.write(stem.with_suffix(".las"))
print("passed")
