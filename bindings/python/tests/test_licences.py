"""Whoever is given the wheel has the licences of everything in it."""

from importlib.metadata import distribution

import pytest


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
def test_wheel_has_the_licences_of_all_that_is_in_it(file: str, owners: list[str]) -> None:
    text = distribution("echocast").read_text(f"licenses/{file}")
    assert text is not None
    for owner in owners:
        assert owner in text
