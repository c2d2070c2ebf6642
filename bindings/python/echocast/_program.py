"""The program `echocast`."""

import signal
import sys

from echocast import _echocast


def main():
    # The program listens for signals itself.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_echocast.program(sys.argv))
