"""The scenario of a run, as it goes to the workers."""

import os

import ray

import echocast as ec
from echocast._echocast import is_path


class Source:
    """A scenario that every worker reads for itself: engines and scenes do not go to other processes.

    `scenario` and `folder`: as `echocast.Scenario` takes them; `settings`: keys that are changed, by their paths.
    """

    def __init__(self, scenario, folder, settings):
        if is_path(scenario):
            self.scenario, self.folder = _place(scenario), ""
        else:
            self.scenario, self.folder = scenario, _place(folder)
        self.settings = dict(settings or {})

    def read(self, threads=None):
        """The scenario, read in this process."""
        scenario = ec.Scenario(self.scenario, folder=self.folder, threads=threads)
        for key, value in self.settings.items():
            scenario.set(key, value)
        return scenario


def _place(path):
    """Where workers find what is at `path` here."""
    # Ray starts workers in the folder that it has shipped to them, if there is one; elsewhere they know no current folder.
    shipped = ray.get_runtime_context().runtime_env.get("working_dir")
    return os.fspath(path) if shipped else os.path.abspath(path)
