"""Writes the reference of the installed package to the file OUTPUT, as HTML: its docstrings, in the order and with the types
of the stubs.

    python -W error reference.py OUTPUT
"""

import ast
import sys
import tempfile
from pathlib import Path
from typing import Any

import pdoc.doc
import pdoc.render

import echocast

STUBS = Path(echocast.__file__).with_name("_echocast.pyi")

# Examples have lines longer than the width of pdoc's page.
STYLE = "main { width: calc(66rem + var(--sidebar-width)); }\n"


def main(output: Path) -> None:
    text = STUBS.read_text()
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "custom.css").write_text(STYLE)
        pdoc.render.configure(docformat="markdown", show_source=False, search=False, template_directory=Path(folder))
        # pdoc finds the stubs of a package under this name, runs them as a program, and expects constructors to be called
        # `__init__`.
        package = Path(folder, "echocast-stubs")
        package.mkdir()
        text = text.replace("def __new__(", "def __init__(")
        (package / "__init__.pyi").write_text("from __future__ import annotations\n" + text)
        sys.path.insert(0, folder)
        # pdoc does not find what is imported when it is used.
        for name in echocast.__all__:
            getattr(echocast, name)
        module = pdoc.doc.Module(echocast)
        order(module, ast.parse(text).body)
        output.parent.mkdir(parents=True, exist_ok=True)
        output.write_text(pdoc.render.html_module(module, {"echocast": module}))


def order(thing: pdoc.doc.Namespace[Any], body: list[ast.stmt]) -> None:
    """Sorts the members of a module or class in the order of its stub; those that it lacks come last."""
    defined = [node for node in body if isinstance(node, (ast.ClassDef, ast.FunctionDef))]
    for node in defined:
        member = thing.members.get(node.name)
        if isinstance(node, ast.ClassDef) and isinstance(member, pdoc.doc.Class):
            order(member, node.body)
    names = [node.name for node in defined if node.name in thing.members]
    names += [name for name in thing.members if name not in names]
    members = {name: thing.members[name] for name in names}
    thing.members.clear()
    thing.members.update(members)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
