"""The examples in Python do what they say."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[3] / "examples" / "python"


def test_a_network_learns_streets() -> None:
    pytest.importorskip("torch")
    command = [sys.executable, str(EXAMPLES / "train_segmentation.py"), "--seconds", "5"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    accuracies = [float(text) for text in re.findall(r"accuracy ([0-9.]+)", done.stdout)]
    assert len(accuracies) >= 2 and accuracies[-1] > 0.6 > accuracies[0], done.stdout
