"""Builds every test of the workspace and runs the programs of tests side by side, as many as there are processors: some
wait, and some use one processor only. The output of each is printed when it ends; then those in documentation run.

    python side-by-side.py
"""

import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

# What takes longest starts first, so that it does not run alone at the end.
LONG = ["physics", "echocast_engine", "formats", "documents", "programs", "determinism", "allocations", "echocast_cloud"]
CARGO_TEST = ["cargo", "test", "--workspace", "--locked"]


def build() -> list[dict[str, Any]]:
    """Messages of Cargo about the programs of tests."""
    command = [*CARGO_TEST, "--no-run", "--message-format=json-render-diagnostics"]
    output = subprocess.run(command, stdout=subprocess.PIPE, check=False)
    if output.returncode:
        sys.exit(output.returncode)
    messages = [json.loads(line) for line in output.stdout.splitlines()]
    return [message for message in messages if message.get("executable") and message["profile"]["test"]]


def run(test: dict[str, Any]) -> tuple[str, "subprocess.CompletedProcess[str]"]:
    """Runs a program as Cargo would; standard input is empty."""
    folder = Path(test["manifest_path"]).parent
    title = f"{folder.name}: {test['target']['name']}, {Path(test['target']['src_path']).relative_to(folder)}"
    environment = {**os.environ, "CARGO_MANIFEST_DIR": str(folder)}
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    start = time.monotonic()
    done = subprocess.run([test["executable"]], cwd=folder, env=environment, text=True, errors="replace", **streams)
    return f"{title}: {time.monotonic() - start:.1f} s", done


def main() -> int:
    place = {name: at for at, name in enumerate(LONG)}
    tests = sorted(build(), key=lambda test: place.get(test["target"]["name"], len(LONG)))
    failed = []
    with ThreadPoolExecutor(os.cpu_count()) as runners:
        for future in as_completed([runners.submit(run, test) for test in tests]):
            title, done = future.result()
            print(f"\n     Running {title}\n{done.stdout}", flush=True)
            if done.returncode:
                failed.append(f"{title} (exit code {done.returncode})")
    # Last, as Cargo runs it itself.
    documentation = subprocess.run([*CARGO_TEST, "--doc"], check=False)
    for title in failed:
        print(f"failed: {title}", file=sys.stderr)
    return int(bool(failed)) or documentation.returncode


if __name__ == "__main__":
    sys.exit(main())
