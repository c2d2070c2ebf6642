"""Whoever is given the wheel has the licences of everything in it."""

import os
import platform
import re
from importlib.metadata import distribution

import pytest


def licence(file: str) -> str:
    """One of the texts in the wheel; "" if it is not there."""
    return distribution("echocast").read_text(f"licenses/{file}") or ""


@pytest.mark.parametrize(
    ("file", "owners"),
    [
        ("LICENSE-MIT", ["The echocast developers"]),
        ("LICENSE-APACHE", ["Apache License"]),
        ("third-party/Embree.txt", ["Intel Corporation"]),
        ("third-party/oneTBB.txt", ["Intel Corporation"]),
        # Notices, C, and a package that is published without its text.
        ("third-party/Rust-packages.txt", ["The Apache Software Foundation", "The HDF Group", "Jean-loup Gailly"]),
        ("third-party/Rust-packages.txt", ["Meta Platforms", "Samuli Raivio"]),
    ],
)
def test_every_wheel_has_these_licences(file: str, owners: list[str]) -> None:
    for owner in owners:
        assert owner in licence(file)


@pytest.mark.skipif(os.environ.get("ECHOCAST_RELEASED") != "true", reason="a wheel for this machine alone")
def test_a_released_wheel_has_the_licences_of_all_that_is_in_it() -> None:
    """It has no library inside but Embree and TBB; of what is linked in, the standard library and Zig's are not packages."""
    files = [path.name for path in distribution("echocast").files or []]
    libraries = [name for name in files if re.match(r"lib.*\.so", name)]
    assert libraries and [name for name in libraries if not re.match(r"lib(embree4|tbb)[-.]", name)] == []
    assert "Copyright" in licence("third-party/Rust-standard-library.html")
    assert platform.machine() != "x86_64" or "Copyright" in licence("third-party/Zig.txt")
