"""Prints the public items of a crate with their signatures, from its documentation as rustdoc wrote it: unlike rustdoc's
JSON, it contains what is exported again from other crates. Left out is what every type has, such as blanket
implementations, and the methods of traits that it implements.

    python public-api.py FOLDER   target/doc/echocast
"""

import sys
from html.parser import HTMLParser
from pathlib import Path

# Sections of implementations that follow from others.
DERIVED = {"synthetic-implementations", "blanket-implementations"}


class Page(HTMLParser):
    """The declaration of an item, and the headers of its implementations and methods."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self.is_derived = False
        # The element whose text is taken, and how many of its kind are open within it, itself included.
        self.taken: tuple[str, int] | None = None
        self.text = ""

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        about = dict(attributes)
        classes = (about.get("class") or "").split()
        self.is_derived = self.is_derived or about.get("id") in DERIVED
        if self.taken and tag == self.taken[0]:
            self.taken = (tag, self.taken[1] + 1)
        elif not self.taken and not self.is_derived and {"code-header", "item-decl"} & set(classes):
            self.taken, self.text = (tag, 1), ""

    def handle_endtag(self, tag: str) -> None:
        if self.taken and tag == self.taken[0]:
            self.taken = (tag, self.taken[1] - 1)
            if self.taken[1] == 0:
                line = " ".join(self.text.replace("\u24d8", "").split())
                # However it was broken into lines.
                self.lines.append(line.replace("( ", "(").replace(", )", ")").replace(" )", ")"))
                self.taken = None

    def handle_data(self, data: str) -> None:
        if self.taken:
            self.text += data


def main(folder: Path) -> None:
    pages = [page for page in folder.rglob("*.html") if page.name not in ("all.html", "index.html")]
    for page in sorted(pages):
        kind, name, *_ = page.name.split(".")
        path = "::".join([*page.relative_to(folder.parent).parent.parts, name])
        parser = Page()
        parser.feed(page.read_text())
        declaration, *headers = dict.fromkeys(parser.lines)
        print(f"{kind} {path}: {declaration}")
        for header in headers:
            if kind == "trait" or not header.startswith("fn "):
                print(f"    {header}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
