"""The scenario of a run, as it is sent to the workers."""

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
    """A scenario that every worker reads for itself: engines and scenes are not sent to other processes.

    `scenario` and `folder`: as for `echocast.Scenario`; `settings`: keys to change, by their paths.
    """

    def __init__(
        self, scenario: "ec.Scenario | Keys", folder: "Path", settings: Mapping[str, Any] | None
    ) -> None:
        scenario, folder = source(scenario, folder)
        self.scenario: "Keys" = scenario
        # With a file no folder is allowed; reading the scenario reports that.
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
    """The path at which workers find what is at `path` here."""
    # Ray starts workers in the folder that it has shipped to them, if there is one; otherwise relative paths are useless to
    # them.
    shipped = ray.get_runtime_context().runtime_env.get("working_dir")
    return os.fspath(path) if shipped else os.path.abspath(path)
