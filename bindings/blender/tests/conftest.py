"""The add-on in this Blender, and an empty scene for every test."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
if packages := os.environ.get("ECHOCAST_BLENDER_PACKAGES"):
    sys.path.insert(0, packages)

import bpy  # noqa: E402
import echocast_blender  # noqa: E402

# What is registered stays so while files are loaded.
echocast_blender.batch.enable()

ENDED: "list[int]" = []


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="also run tests that take long or much memory")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "slow: takes more than ten seconds, or several GB; only with --slow")


def pytest_collection_modifyitems(config: pytest.Config, items: "list[pytest.Item]") -> None:
    for item in items:
        if "slow" in item.keywords and not config.getoption("--slow"):
            item.add_marker(pytest.mark.skip(reason="only with --slow"))


@pytest.fixture(autouse=True)
def empty_scene() -> Iterator[None]:
    """Factory settings without any object, and no file."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    yield


def pytest_sessionfinish(exitstatus: int) -> None:
    ENDED.append(int(exitstatus))


@pytest.hookimpl(trylast=True)
def pytest_unconfigure() -> None:
    # As a module, Blender 4.2 crashes when Python ends: it frees panels after that.
    if ENDED and not bpy.app.binary_path and bpy.app.version < (4, 3):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(ENDED[0])
