"""The scenario of a run, as it goes to the workers."""

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import ray

import echocast as ec
from echocast._echocast import is_path
from echocast._training import source

if TYPE_CHECKING:
    from echocast._echocast import Keys, Path


class Source:
    """A scenario that every worker reads for itself: engines and scenes do not go to other processes.

    `scenario` and `folder`: as `echocast.Scenario` takes them; `settings`: keys that are changed, by their paths.
    """

    def __init__(
        self, scenario: "ec.Scenario | Keys", folder: "Path", settings: Mapping[str, Any] | None
    ) -> None:
        scenario, folder = source(scenario, folder)
        self.scenario: "Keys" = scenario
        # Beside a file there is none, as reading it will tell.
        self.folder: "Path" = folder
        if is_path(scenario):
            self.scenario = _place(scenario)
        else:
            self.folder = _place(folder)
        self.settings = dict(settings or {})

    def read(self, threads: int | None = None) -> ec.Scenario:
        """The scenario, read in this process."""
        scenario = ec.Scenario(self.scenario, folder=self.folder, threads=threads)
        for key, value in self.settings.items():
            scenario.set(key, value)
        return scenario


def _place(path: "Path") -> str:
    """Where workers find what is at `path` here."""
    # Ray starts workers in the folder that it has shipped to them, if there is one; elsewhere they know no current folder.
    shipped = ray.get_runtime_context().runtime_env.get("working_dir")
    return os.fspath(path) if shipped else os.path.abspath(path)
