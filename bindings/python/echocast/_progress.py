"""The progress bar of `progress=True`: how far a scan or a run has got, and how much time is left."""

import sys
import threading
import time
from typing import Any, Protocol, TextIO

#: s between updates of a bar.
INTERVAL = 0.1

#: Characters of a bar.
WIDTH = 30


def bar(what: str) -> "Bar":
    """A bar titled `what` for the notebook or terminal that this program runs in. It is called with a fraction, 0 to 1, or
    with the number done and the total, and shows them; `close()` leaves the last state visible. Elsewhere it shows
    nothing."""
    if in_notebook():
        return Bar(what, NotebookScreen())
    if sys.stderr is not None and sys.stderr.isatty():
        return Bar(what, TerminalScreen(sys.stderr))
    return Bar(what, None)


def in_notebook() -> bool:
    """Whether a Jupyter kernel runs this program."""
    # In a notebook, IPython has been imported.
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    return getattr(shell, "kernel", None) is not None


class Screen(Protocol):
    """Where a line is shown until another replaces it."""

    def draw(self, line: str) -> None: ...

    def close(self) -> None: ...


class Bar:
    """Shows progress on `screen`, if there is one, from any thread."""

    def __init__(self, what: str, screen: Screen | None) -> None:
        self.what, self.screen = what, screen
        self.start = time.monotonic()
        self.shown: float | None = None
        self.last = self.drawn = ""
        self.lock = threading.Lock()

    def __call__(self, done: float, of: float | None = None) -> None:
        if self.screen is None:
            return
        now = time.monotonic()
        with self.lock:
            self.last = self._line(done, of, now - self.start)
            if self.shown is None or now - self.shown >= INTERVAL:
                self._draw(self.screen, now)

    def close(self) -> None:
        """Shows the last reported state, and ends the line."""
        with self.lock:
            if self.screen is None or not self.last:
                return
            self._draw(self.screen, time.monotonic())
            self.screen.close()
            self.screen = None

    def _draw(self, screen: Screen, now: float) -> None:
        if self.last != self.drawn:
            screen.draw(self.last)
        self.shown, self.drawn = now, self.last

    def _line(self, done: float, of: float | None, spent: float) -> str:
        fraction = done if of is None else done / of if of else 1.0
        fraction = min(max(fraction, 0.0), 1.0)
        full = round(fraction * WIDTH)
        count = "" if of is None else f" {done} of {of}"
        if fraction == 1:
            left = f" in {clock(spent)}"
        else:
            left = f", {clock(spent / fraction - spent)} left" if fraction else ""
        return f"{self.what} {'█' * full}{'░' * (WIDTH - full)} {fraction:4.0%}{count}{left}"


def clock(seconds: float) -> str:
    """A time in clock notation: 0:07, 1:02:03."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"


class TerminalScreen:
    """One line that is overwritten."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def draw(self, line: str) -> None:
        # ASCII for terminals that cannot display the blocks.
        try:
            line.encode(self.stream.encoding or "ascii")
        except UnicodeEncodeError:
            line = line.replace("█", "#").replace("░", ".")
        # Back to the start of the line, and clear what remains of the previous one.
        self.stream.write(f"\r{line}\x1b[K")
        self.stream.flush()

    def close(self) -> None:
        self.stream.write("\n")
        self.stream.flush()


class NotebookScreen:
    """The output of a cell, which is updated in place."""

    def __init__(self) -> None:
        self.handle: Any = None

    def draw(self, line: str) -> None:
        from IPython.display import Pretty, display

        # Plain text, which every notebook front end can show.
        if self.handle is None:
            self.handle = display(Pretty(line), display_id=True)
        else:
            self.handle.update(Pretty(line))

    def close(self) -> None:
        self.handle = None
