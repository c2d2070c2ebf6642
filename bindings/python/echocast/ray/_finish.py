"""Completes a set: writes the files about all samples together, as `echocast run --finish` does."""

import json
import tempfile
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

import echocast as ec
from echocast.ray._plan import is_log
from echocast.ray._store import UNFINISHED, Store

#: Lists the files about all samples together.
WHOLE = "files.json"

#: Folders of the pieces that tables and archives are joined from.
PIECES = {"pieces", ".pieces"}


def finish(store: Store, roots: Sequence[str]) -> None:
    """Completes the set in `store`, in which no sample is missing. `roots`: the folders of its styles."""
    names = store.sizes()
    # Left by workers that were killed.
    left = [name for name in names if PurePosixPath(name).name.startswith(UNFINISHED)]
    store.remove(left)
    if store.folder is not None:
        _folders(store.folder, roots)
        ec.finish(store.folder)
        return
    with tempfile.TemporaryDirectory(prefix="echocast-") as folder:
        _folders(Path(folder), roots)
        store.fetch([name for name in names if _is_joined(name) and name not in left], folder)
        old = _whole(folder)
        before = _files(folder)
        try:
            ec.finish(folder, check=False)
        except ec.Error as error:
            raise type(error)(str(error).replace(folder, store.name)) from error
        after = _files(folder)
        new = [name for name, stamp in after.items() if before.get(name) != stamp]
        # The manifest says where samples are, so it is written after them.
        store.put([name for name in new if name != "manifest.json"], folder)
        store.put(["manifest.json"], folder)
        store.remove((before.keys() - after.keys()) | (old - _whole(folder)).intersection(names))


def _folders(folder: Path, roots: Sequence[str]) -> None:
    """Creates the folders of a set, which object stores do not have."""
    for name in [*roots, "samples", "pictures"]:
        Path(folder, name).mkdir(parents=True, exist_ok=True)


def _is_joined(name: str) -> bool:
    """Whether a file of a set is read when it is completed."""
    path = PurePosixPath(name)
    return (
        name in ("scenario.json", "manifest.json", WHOLE)
        or is_log(name)
        or path.parts[0] in ("samples", "pictures")
        or bool(PIECES.intersection(path.parts))
        # Archives from before the set grew.
        or (path.parts[0] == "webdataset" and path.suffix == ".tar")
    )


def _whole(folder: str | Path) -> set[str]:
    """Names of the files about the whole set."""
    path = Path(folder, WHOLE)
    return {file["path"] for file in json.loads(path.read_text())} if path.exists() else set()


def _files(folder: str | Path) -> dict[str, tuple[int, int]]:
    """The files in a folder by name, with modification time and inode."""
    found = [path for path in Path(folder).rglob("*") if path.is_file()]
    stamps = {path: path.stat() for path in found}
    return {path.relative_to(folder).as_posix(): (stamp.st_mtime_ns, stamp.st_ino) for path, stamp in stamps.items()}
