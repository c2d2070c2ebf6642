"""The program `echocast`."""

import signal
import sys
from typing import NoReturn

from echocast import _echocast


def main() -> NoReturn:
    """Runs it with the arguments of this process, which ends with its exit code."""
    # The program listens for signals itself.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_echocast.program(sys.argv))
