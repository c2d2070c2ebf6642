"""Where a set is written to: a folder, or a prefix of a bucket."""

import contextlib
import os
import uuid
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import fsspec
from fsspec import AbstractFileSystem
from fsspec.implementations.arrow import ArrowFSWrapper
from fsspec.implementations.local import LocalFileSystem

import echocast as ec

#: Prefix of the names of incomplete files.
UNFINISHED = ".echocast-"


class Store:
    """A folder of a file system. Names of files are relative to it, with `/`.

    `output`: a path, a URL that fsspec supports, or with `filesystem`, of fsspec or pyarrow, a path in it.
    """

    def __init__(self, output: str | os.PathLike[str], filesystem: Any = None) -> None:
        self.name = os.fspath(output).rstrip("/")
        with self._telling("reached"):
            root = self.name
            if filesystem is None:
                filesystem, root = fsspec.url_to_fs(root)
            # File systems without their own rename would copy.
            self.renames = getattr(type(filesystem), "mv", None) is not AbstractFileSystem.mv
            if not isinstance(filesystem, AbstractFileSystem):
                self.renames = filesystem.type_name not in ("s3", "gcs", "abfs")
                filesystem = LocalFileSystem() if filesystem.type_name == "local" else ArrowFSWrapper(filesystem)
            self.fs, self.root = filesystem, filesystem._strip_protocol(root).rstrip("/")
        #: The folder, if it is on a local file system.
        self.folder = Path(self.root) if isinstance(filesystem, LocalFileSystem) else None

    def sizes(self) -> dict[str, int]:
        """Sizes of all files in bytes, by name."""
        with self._telling("read"):
            self.fs.invalidate_cache()
            try:
                found = self.fs.find(self.root, detail=True)
            except FileNotFoundError:
                return {}
            start = len(self.root) + 1
            return {path[start:]: about["size"] for path, about in found.items()}

    def find(self, name: str) -> bytes | None:
        """The contents of a file; None if it does not exist."""
        with self._telling("read"):
            try:
                content: bytes = self.fs.cat_file(self._path(name))
                return content
            except (FileNotFoundError, NotADirectoryError):
                return None

    def read(self, names: Sequence[str]) -> dict[str, bytes]:
        """Contents of files by name."""
        with self._telling("read"):
            paths = {self._path(name): name for name in names}
            contents = self.fs.cat(list(paths)) if paths else {}
            return {paths[path]: content for path, content in contents.items()}

    def fetch(self, names: Sequence[str], folder: str | Path) -> None:
        """Copies files to `folder` on this machine."""
        with self._telling("read"):
            if names:
                self.fs.get([self._path(name) for name in names], [str(Path(folder, name)) for name in names])

    def put(self, names: Sequence[str], folder: str | Path) -> None:
        """Copies files from `folder` on this machine; each appears when it is complete."""
        with self._telling("written"):
            if not self.renames:
                # Object stores only show complete files. Many are sent at a time.
                if names:
                    self.fs.put([str(Path(folder, name)) for name in names], [self._path(name) for name in names])
                return
            for parent in sorted({os.path.dirname(self._path(name)) for name in names}):
                self.fs.makedirs(parent, exist_ok=True)
            for name in names:
                # Two workers may write the same sample, if one was taken for dead.
                pending = f"{os.path.dirname(self._path(name))}/{UNFINISHED}{uuid.uuid4().hex}"
                try:
                    self.fs.put_file(str(Path(folder, name)), pending)
                    self.fs.mv(pending, self._path(name))
                except BaseException:
                    with contextlib.suppress(Exception):
                        self.fs.rm_file(pending)
                    raise

    def remove(self, names: Iterable[str]) -> None:
        """Removes files."""
        with self._telling("written"):
            paths = [self._path(name) for name in names]
            if self.fs.async_impl and paths:
                self.fs.rm(paths)
            else:
                for path in paths:
                    self.fs.rm_file(path)

    def _path(self, name: str) -> str:
        return f"{self.root}/{name}"

    @contextlib.contextmanager
    def _telling(self, what: str) -> Iterator[None]:
        """Turns errors of any file system into a sentence on what could not be done."""
        try:
            yield
        except Exception as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise ec.FileError(f"{self.name} cannot be {what}: {reason}") from error
