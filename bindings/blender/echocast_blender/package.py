"""Finds the Python package `echocast`: as an extension Blender has installed it; the zip for Blender before 4.2 contains it,
in the folder `packages`."""

import importlib.util
import platform
import sys
from pathlib import Path

#: The oldest Python, and the oldest C library, that the package runs with.
PYTHON, GLIBC = (3, 10), (2, 28)


def find() -> None:
    """Makes `import echocast` work, or raises ImportError with a sentence that says why it cannot."""
    if sys.version_info < PYTHON:
        found = ".".join(map(str, sys.version_info[:2]))
        raise ImportError(f"this Blender has Python {found}; allowed: {'.'.join(map(str, PYTHON))} or later")
    name, version = platform.libc_ver()
    if name == "glibc" and tuple(map(int, version.split(".")[:2])) < GLIBC:
        raise ImportError(f"this system has glibc {version}; allowed: {'.'.join(map(str, GLIBC))} or later")
    packages = Path(__file__).parent / "packages"
    if packages.is_dir() and str(packages) not in sys.path:
        # Before others: an older echocast may be installed.
        sys.path.insert(0, str(packages))
    if importlib.util.find_spec("echocast") is None:
        raise ImportError("the Python package echocast is missing: install the add-on from its zip as it is")
    try:
        import echocast  # noqa: F401
    except ImportError as error:
        raise ImportError(f"the Python package echocast cannot be loaded: {error}") from error
