"""Every public name says what it is, and examples do what they show: in docstrings, and in the documents."""

import ast
import doctest
import importlib
import importlib.util
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import echocast as ec
from echocast._echocast import columns

ROOT = Path(__file__).parents[3]

#: Packages that examples need beside NumPy.
NEEDS = {
    "echocast.PointCloud.to_open3d": "open3d",
    "echocast.PointCloud.to_pandas": "pandas",
    "echocast.PointCloud.to_torch": "torch",
    "echocast.show": "rerun",
}


def is_there(package: str) -> bool:
    return importlib.util.find_spec(package) is not None


def modules() -> Iterator[ModuleType]:
    yield ec
    for name in ("torch", "ray"):
        if is_there(name):
            yield importlib.import_module(f"echocast.{name}")


def public() -> Iterator[tuple[str, Any]]:
    """Modules, what they have, and what classes among that have, with their names. doctest finds no docstrings of
    extension modules by itself."""
    for module in modules():
        yield module.__name__, module
        for name in module.__all__:
            thing = getattr(module, name)
            if isinstance(thing, str):
                continue
            yield f"{module.__name__}.{name}", thing
            if isinstance(thing, type):
                # Not what OSError and torch's classes have.
                own = [vars(base) for base in thing.__mro__ if base.__module__.startswith("echocast")]
                for member in sorted({member for names in own for member in names if not member.startswith("_")}):
                    yield f"{module.__name__}.{name}.{member}", getattr(thing, member)


def examples() -> list[str]:
    return [name for name, thing in public() if ">>> " in (thing.__doc__ or "")]


def test_public_names_have_docstrings() -> None:
    assert [name for name, thing in public() if not (thing.__doc__ or "").strip()] == []


def test_classes_and_functions_have_examples() -> None:
    own = {f"{module.__name__}.{name}" for module in modules() for name in module.__all__}
    things = [name for name, thing in public() if name in own and callable(thing) and not is_error(thing)]
    assert len(things) > 15 and set(things) - set(examples()) == set()


def is_error(thing: Any) -> bool:
    return isinstance(thing, type) and issubclass(thing, Exception)


@pytest.mark.parametrize("name", examples())
def test_examples_do_what_they_show(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    if name.startswith("echocast.ray."):
        ray = importlib.import_module("ray")
        ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="error")
        request.addfinalizer(ray.shutdown)
    monkeypatch.chdir(tmp_path)
    text = inspect.cleandoc(dict(public())[name].__doc__)
    test = doctest.DocTestParser().get_doctest(text, {"ec": ec, "np": np}, name, None, 0)
    told: list[str] = []
    assert doctest.DocTestRunner(verbose=False).run(test, out=told.append).failed == 0, "".join(told)


def test_scan_explains_every_keyword() -> None:
    with pytest.raises(TypeError) as caught:
        ec.LiveScene().scan("velodyne_vlp16", nonsense=1)  # type: ignore[call-arg]
    known = str(caught.value).partition("allowed: ")[2].split(", ")
    told = re.findall(r"^\* `(\w+)`:", ec.Scene.scan.__doc__ or "", re.MULTILINE)
    assert len(known) > 15 and sorted(told) == sorted(known)


def test_columns_are_all_told() -> None:
    told = set(re.findall(r"`(\w+)`", (ec.PointCloud.__doc__ or "").partition("| columns |")[2]))
    square = np.array([[5, -3, -3], [5, 3, -3], [5, 0, 3]], dtype=np.float32)
    scene = ec.Scene.from_arrays(square, np.array([[0, 1, 2]], dtype=np.uint32))
    assert set(scene.scan("velodyne_vlp16", fields="all").fields) - told == set()


def blocks(document: str) -> list[str]:
    """The Python in a document."""
    return re.findall(r"^```python\n(.*?)^```", (ROOT / document).read_text(), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("document", ["README.md", "docs/python.md", "docs/cluster.md"])
def test_documents_have_python_that_compiles(document: str) -> None:
    found = blocks(document)
    assert found or document == "docs/cluster.md"
    for block in found:
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.ImportFrom) and node.module:
                module = pytest.importorskip(node.module, exc_type=ImportError)
                assert [name.name for name in node.names if not hasattr(module, name.name)] == []


def check_street(names: dict[str, Any]) -> None:
    """What the first block of the documents has made."""
    assert names["cloud"].categories[10] == "road"
    assert ec.PointCloud.read("near.las").range.max() < 20


def test_the_block_of_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    # The commands before it have made this.
    ec.Scene.generate("street", path="street.glb")
    names: dict[str, Any] = {}
    exec(blocks("README.md")[0], names)
    check_street(names)


#: What the blocks of the page on Python need beside NumPy.
PAGE = [[], ["torch"], ["rerun"], ["matplotlib"]]


@pytest.mark.parametrize("number", range(len(PAGE)))
def test_the_page_on_python_runs_from_an_empty_folder(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = blocks("docs/python.md")
    assert len(found) == len(PAGE)
    for package in PAGE[number]:
        pytest.importorskip(package)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    names: dict[str, Any] = {"__name__": "__main__"}
    exec(found[0], names)
    check_street(names)
    if number > 0:
        # Few epochs of few samples are enough to see that it runs.
        for long, short in {"range(10)": "range(1)", "range(80)": "range(4)", "range(80, 100)": "range(80, 84)"}.items():
            found[1] = found[1].replace(long, short)
        exec(found[number], names)
    if number == 1:
        item = names["held_out"][3]
        assert item["sample"] == 83 and set(item) == {"positions", "sample", "intensity", "category_id"}
        assert len(item["intensity"]) == len(item["category_id"]) == len(item["positions"]) > 0
        assert "positions" in names["batch"]
    if number == 2:
        assert Path("cloud.rrd").exists() and Path("drive.rrd").exists()
    if number == 3:
        assert Path("cloud.png").exists()


def test_types_tell_every_column() -> None:
    """A column that the stub lacks would be an error of type checkers; the class there has no other names."""
    tree = ast.parse((ROOT / "bindings/python/echocast/_echocast.pyi").read_text())
    (found,) = [node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == "Columns"]
    told = [(node.name, ast.unparse(node.returns)) for node in found.body if isinstance(node, ast.FunctionDef) and node.returns]
    types = {"float32": "Float32Array", "float64": "Float64Array", "uint8": "UInt8Array", "uint16": "UInt16Array"}
    types["uint32"] = "UInt32Array"
    assert told == [(name, types[kind]) for name, kind, _, _ in columns()]
    assert len(told) == len(found.body) > 50
