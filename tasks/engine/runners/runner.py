"""Where stages compute: in threads of the flow's process, in children of it, or on workers of Dask or Ray.

A stage stays a task of the flow wherever it computes: its name, state and retries, the run's budget, the slot of the
limit `gpu` and the log are the flow's, and only a `Job` goes to a worker. So a worker needs humanmm, the store and the
video, but not Prefect or its server, and all runners are the same to an observer.

Prefect's own task runners for both engines move the whole task. Measured (docs/scale.md): the engine repeats a task
whose worker died, three times, and the flow counts one attempt; a task whose workers keep dying is still `Running` in
Prefect 20 s after its flow has ended; each worker talks to the server.
"""

import importlib.util
from typing import Protocol

from humanmm.config import RunConfig
from humanmm.errors import ConfigError
from humanmm.tasks.engine.runners.job import Job, Progress, Setting
from humanmm.tasks.engine.runners.processes import Children
from humanmm.tasks.units.execute import Result

_LIBRARIES = {"dask": "distributed", "ray": "ray"}


class Workers(Protocol):
    """Processes that compute jobs for one run."""

    def open(self) -> None:
        """Start what jobs need, once; from one thread at a time. ResourceError if it cannot."""
        ...

    def compute(self, job: Job, label: str, *, isolated: bool, limit_s: float | None, progress: Progress) -> Result:
        """Compute a job. TimeLimitError if it took too long, ResourceError if its process died, else its own error.

        With `isolated` or a limit its process computes nothing else meanwhile, and can be killed.
        """
        ...

    def close(self) -> None:
        """End all that still compute, and what was started for them; no other call follows."""
        ...


def workers_of(setting: Setting) -> Workers:
    """The processes that the settings name; none is started before there is a job."""
    run = setting.config.run
    if run.runner == "dask":
        from humanmm.tasks.engine.runners.dask_runner import DaskWorkers

        return DaskWorkers(setting, num_workers=run.threads, address=run.cluster)
    if run.runner == "ray":
        from humanmm.tasks.engine.runners.ray_runner import RayWorkers

        return RayWorkers(setting, num_workers=run.threads, address=run.cluster)
    return Children(setting)


def check_runner(run: RunConfig) -> None:
    """ConfigError if the library of `run.runner` is not installed."""
    library = _LIBRARIES.get(run.runner)
    if library is not None and importlib.util.find_spec(library) is None:
        raise ConfigError(
            f"run.runner = {run.runner} needs a library that is not installed: pip install 'humanmm[{run.runner}]'"
        )
