"""Plans which samples are made: those that are requested and missing, divided into tasks."""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import echocast as ec

if TYPE_CHECKING:
    from echocast.ray._store import Store

#: Most samples of a task: all of them are made again when a worker dies.
MOST = 32

#: Fewest samples of a task, if there are enough: each task begins with work that its samples share.
LEAST = 4


def wanted(count: int, samples: Sequence[int] | None) -> range:
    """The requested samples of a scenario that has `count`: a range."""
    given = (0, count - 1) if samples is None else tuple(samples)
    if len(given) not in (2, 3):
        raise ec.ArgumentError(f"samples is {len(given)} numbers; allowed: first and last, and a step")
    first, last, step = (*given, 1)[:3]
    if not 0 <= first <= last < count or step < 1:
        found = f"{first} to {last}, every {step}"
        raise ec.ArgumentError(f"samples is {found}; allowed: 0 to {count - 1}, which the scenario has")
    return range(first, last + 1, step)


def noted(store: "Store", sizes: Mapping[str, int]) -> dict[int, dict[str, Any]]:
    """The entries of a set's manifests by sample number: the newest success, else a failure."""
    names = [name for name in sizes if name == "manifest.json" or is_log(name)]
    known: dict[int, dict[str, Any]] = {}
    for name, text in sorted(store.read(names).items()):
        for entry in json.loads(text) if name == "manifest.json" else _lines(text):
            old = known.get(entry["sample"])
            if old is None or "error" in old or "error" not in entry:
                known[entry["sample"]] = entry
    return known


def is_log(name: str) -> bool:
    """Whether this is the manifest of a task, shard or run, which is removed when the set is complete."""
    return name.startswith("manifest") and name.endswith(".jsonl")


def _lines(text: bytes) -> Iterator[Any]:
    for line in text.splitlines():
        try:
            yield json.loads(line)
        except ValueError:
            # Half a line, left by a run that was killed.
            pass


def complete(entry: Mapping[str, Any], sizes: Mapping[str, int]) -> bool:
    """Whether a sample was made and all its files exist, with their sizes."""

    def is_there(file: Mapping[str, Any]) -> bool:
        size, length = sizes.get(file["path"], -1), int(file["bytes"])
        offset: int | None = file.get("offset")
        return size == length if offset is None else size >= offset + length

    return "error" not in entry and all(map(is_there, entry["files"]))


def tasks(numbers: Sequence[int], workers: int, most: int | None = None) -> list[range]:
    """Divides `numbers`, which must increase, into ranges for `workers`: of up to `most`, or if that is None, longer ones
    first and shorter ones at the end, so that all workers finish at about the same time."""
    least = max(1, min(LEAST, len(numbers) // (4 * workers)))
    made: list[list[int]] = []
    size = 0
    for index, number in enumerate(numbers):
        last = made[-1] if made else []
        if 0 < len(last) < size and (len(last) == 1 or number - last[-1] == last[1] - last[0]):
            last.append(number)
        else:
            made.append([number])
            size = most or max(least, min(MOST, (len(numbers) - index) // (2 * workers)))
    return [range(task[0], task[-1] + 1, task[1] - task[0] if len(task) > 1 else 1) for task in made]
