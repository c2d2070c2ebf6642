"""maturin, after a look at what building needs, which compilers report late and less clearly.

In a checkout scripts/setup looks, and Embree is put into the wheel, unless it is the system's; a source distribution has
neither script."""

import os
import subprocess
from contextlib import contextmanager
from pathlib import Path

import maturin
from maturin import *  # noqa: F403 what is not changed here

# So that `pip install .` in the root of the repository builds this package too.
os.chdir(Path(__file__).parent)
SCRIPTS = Path("../../scripts")


def get_requires_for_build_wheel(config_settings=None):
    if SCRIPTS.exists():
        if subprocess.run([SCRIPTS / "setup", "--check"]).returncode:
            raise SystemExit(1)
    elif "HDF5_DIR" not in os.environ and subprocess.run(["sh", "-c", "pkg-config --exists hdf5"]).returncode:
        raise SystemExit("building echocast needs Rust, a C compiler, pkg-config and HDF5 (Debian: libhdf5-dev pkg-config)")
    return maturin.get_requires_for_build_wheel(config_settings)


get_requires_for_build_editable = get_requires_for_build_wheel


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    with embree_inside():
        return maturin.build_wheel(wheel_directory, config_settings, metadata_directory)


@contextmanager
def embree_inside():
    """While the package contains Embree, beside the module."""
    package = Path("echocast")
    if SCRIPTS.exists():
        subprocess.run([SCRIPTS / "embree", package], check=True)
    try:
        yield
    finally:
        for library in package.glob("lib*.so*"):
            library.unlink()
