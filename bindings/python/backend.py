"""maturin, after scripts/setup has checked that nothing is missing: compilers report that late and less clearly."""

import os
import subprocess
from pathlib import Path

import maturin
from maturin import *  # noqa: F403 what is not changed here

# So that `pip install .` in the root of the repository builds this package too.
os.chdir(Path(__file__).parent)


def get_requires_for_build_wheel(config_settings=None):
    if subprocess.run(["../../scripts/setup", "--check"]).returncode:
        raise SystemExit(1)
    return maturin.get_requires_for_build_wheel(config_settings)


get_requires_for_build_editable = get_requires_for_build_wheel
