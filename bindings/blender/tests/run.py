"""Runs the tests in a Blender program, whose Python has no pytest:

    pip install --target DIR pytest
    ECHOCAST_BLENDER_SITE=DIR blender -b --factory-startup --python-exit-code 1 --python run.py -- [arguments of pytest]

ECHOCAST_BLENDER_PACKAGES: an unpacked wheel of echocast, if the add-on does not contain it.
"""

import os
import sys
from pathlib import Path

for name in ("ECHOCAST_BLENDER_SITE", "ECHOCAST_BLENDER_PACKAGES"):
    if folder := os.environ.get(name):
        sys.path.insert(0, folder)

import pytest  # noqa: E402

arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
paths = [argument for argument in arguments if Path(argument.split("::")[0]).exists()]
code = pytest.main([*arguments, *([] if paths else [str(Path(__file__).parent)])])
# Blender ends with 0 if there is no such script: callers look for this line.
print(f"echocast: tests ended with {int(code)}")
raise SystemExit(int(code))
