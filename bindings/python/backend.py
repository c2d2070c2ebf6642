"""maturin, after scripts/setup has checked that nothing is missing: compilers report that late and less clearly.

Embree, where it is not the system's, is put into the wheel."""

import os
import subprocess
from contextlib import contextmanager
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


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    with embree_inside():
        return maturin.build_wheel(wheel_directory, config_settings, metadata_directory)


@contextmanager
def embree_inside():
    """While the package contains Embree, beside the module."""
    package = Path("echocast")
    subprocess.run(["../../scripts/embree", package], check=True)
    try:
        yield
    finally:
        for library in package.glob("lib*.so*"):
            library.unlink()
