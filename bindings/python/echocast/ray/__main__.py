"""The command `python -m echocast.ray`."""

import argparse
import os
import re
import sys
import time
from typing import Any

import echocast as ec
import echocast.ray
from echocast._convert import package

EXAMPLES = """\
examples:
  python -m echocast.ray drive.yaml -o /shared/drive
  python -m echocast.ray drive.yaml --samples 0:99999 --address auto -o s3://bucket/set
  python -m echocast.ray drive.yaml --set samples=200000 --resume --address auto -o s3://bucket/set
from a machine that shares no files with the cluster:
  python -m echocast.ray drive.yaml --ship --address ray://head:10001 -o s3://bucket/set

exit codes: 0 success; 1 the run failed, in whole or in part (--resume continues it); 2 wrong usage; 130 interrupted
"""

#: s between lines of progress.
PERIOD = 5.0


def samples(text: str) -> tuple[int, ...]:
    """`A:B[:STEP]` as numbers."""
    try:
        numbers = tuple(int(number) for number in text.split(":"))
    except ValueError:
        numbers = ()
    if len(numbers) not in (2, 3):
        raise argparse.ArgumentTypeError(f"{text!r}: expected FIRST:LAST or FIRST:LAST:STEP, such as 0:999")
    return numbers


def setting(text: str) -> tuple[str, Any]:
    """`KEY=VALUE` as the key and its value, which is YAML."""
    key, equals, value = text.partition("=")
    if not (key and equals):
        raise argparse.ArgumentTypeError(f"{text!r}: expected KEY=VALUE, such as samples=20")
    try:
        return key, yaml(value)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: {' '.join(str(error).split())}") from error


def yaml(text: str) -> Any:
    """A value of YAML 1.2, where `on` is a string."""
    yaml = package("yaml", "'ray[data]'")

    class Loader(yaml.SafeLoader):  # type: ignore[name-defined]
        yaml_implicit_resolvers: dict[str, Any] = {}

    for tag, pattern, first in [
        ("null", "~|null|", "~n\0"),
        ("bool", "true|false", "tf"),
        ("int", "[-+]?[0-9]+", "-+0123456789"),
        ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", "-+.0123456789"),
    ]:
        Loader.add_implicit_resolver(f"tag:yaml.org,2002:{tag}", re.compile(f"^(?:{pattern})$"), list(first))
    try:
        return yaml.load(text, Loader)
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from error


def positive(text: str) -> int:
    """A whole number of 1 or more."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number, 1 or more")
    return int(text)


def arguments() -> argparse.ArgumentParser:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="python -m echocast.ray",
        description="Make a set of samples from a scenario file on a Ray cluster. The files are identical, byte for byte, to "
        "those of `echocast run` on one machine.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("scenario", metavar="SCENARIO", help="scenario file (docs/scenario.md), which workers must find too")
    add("-o", "--output", metavar="FOLDER", required=True, help="folder of the set, shared by all machines, or its URL")
    add("--samples", metavar="A:B[:STEP]", type=samples, help="samples A to B, both included, every STEPth [default: all]")
    add("--resume", action="store_true", help="continue where a run has stopped: existing samples are not made again")
    help = "change one key of the scenario by its path; repeatable"
    add("--set", metavar="KEY=VALUE", type=setting, action="append", default=[], help=help)
    help = "cluster to connect to: `auto`, HOST:PORT or ray://HOST:PORT [default: one running here, else this machine]"
    add("--address", help=help)
    add("--workers", metavar="N", type=positive, help="processes, with one CPU each [default: the CPUs of the cluster]")
    add("--chunk", metavar="N", type=positive, help="samples per task [default: up to 32]")
    add("--ship", action="store_true", help="send the current folder, with scenario and scenes, to the workers")
    add("-q", "--quiet", action="store_true", help="print only errors")
    return parser


class Progress:
    """Lines of progress on stderr, at most one per `PERIOD`."""

    def __init__(self, quiet: bool) -> None:
        self.quiet = quiet
        self.first: tuple[float, int] | None = None
        self.last = time.monotonic()

    def __call__(self, done: int, all: int) -> None:
        now = time.monotonic()
        self.first = self.first or (now, done)
        if self.quiet or now - self.last < PERIOD:
            return
        self.last = now
        rate = (done - self.first[1]) / (now - self.first[0])
        left = f", {(all - done) / rate / 60:.0f} min left" if rate > 0 else ""
        print(f"{done} of {all} samples, {rate:.1f} a second{left}", file=sys.stderr, flush=True)


def summarised(done: dict[str, Any]) -> str:
    """The summary printed at the end of a run."""
    made = done["made"] + len(done["failed"])
    lines = [
        f"{made} samples made in {done['seconds']:.1f} s ({made / done['seconds']:.1f} a second, {done['workers']} workers), "
        f"{done['points']:,} points"
    ]
    if done["found"]:
        lines.append(f"  {done['found']} were there")
    lines += [f"  sample {sample} has failed: {error}" for sample, error in done["failed"][:10]]
    lines.append(f"  {done['folder']}: {'complete, see report.html' if done['complete'] else 'not complete yet'}")
    return "\n".join(lines)


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Connects to the cluster and makes the set."""
    ray = package("ray", "'ray[data]'")
    shipped = {"working_dir": os.getcwd()} if args.ship else {}
    try:
        ray.init(address=args.address, runtime_env=shipped, log_to_driver=False, logging_level="error")
    except (OSError, ValueError, RuntimeError, ray.exceptions.RayError) as error:
        raise ec.Error(f"--address {args.address}: {error}") from error
    return echocast.ray.run(
        args.scenario,
        args.output,
        samples=args.samples,
        resume=args.resume,
        workers=args.workers,
        chunk=args.chunk,
        settings=dict(args.set),
        progress=Progress(args.quiet),
    )


def main() -> int:
    """Runs the command with the arguments of this process; returns its exit code."""
    args = arguments().parse_args()
    try:
        done = run(args)
    except KeyboardInterrupt:
        print("interrupted; --resume continues the run", file=sys.stderr)
        return 130
    except (ec.Error, ImportError) as error:
        print(f"error: {' '.join(str(error).split())}", file=sys.stderr)
        # The message begins with the name of the option.
        return 2 if isinstance(error, ec.ArgumentError) and str(error).startswith("samples is ") else 1
    if not args.quiet:
        for warning, count in done["warnings"].items():
            print(f"warning: {warning}{f' ({count} samples)' if count > 1 else ''}", file=sys.stderr)
        print(summarised(done))
    for sample, told in done["failed"][:1]:
        others = len(done["failed"]) - 1
        more = f" (and {others} more)" if others else ""
        print(f"error: sample {sample} has failed: {told}{more}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
