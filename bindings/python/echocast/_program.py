"""The program `echocast`."""

import signal
import sys
from typing import NoReturn

from echocast import _echocast


def main() -> NoReturn:
    """Runs the program with the arguments of this process, which ends with its exit code."""
    # The program handles signals itself.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_echocast.program(sys.argv))
