"""One continuous human motion in one metric world, from a video with cuts (HumanMM, CVPR 2025).

    import humanmm

    run = humanmm.recover("film.mp4")
    run.people[0].joints  # (N, 24, 3), metres, world

`import humanmm` alone loads no library: a name is imported when it is first used.
"""

import importlib
from typing import TYPE_CHECKING, Any

from humanmm.errors import HumanMMError
from humanmm.version import __version__

if TYPE_CHECKING:
    from humanmm.config import Config
    from humanmm.corrections import Corrections
    from humanmm.recovery import forecast, recover
    from humanmm.results import Run, evaluate, load

_MODULES = {
    "Config": "humanmm.config",
    "Corrections": "humanmm.corrections",
    "forecast": "humanmm.recovery",
    "recover": "humanmm.recovery",
    "Run": "humanmm.results",
    "evaluate": "humanmm.results",
    "load": "humanmm.results",
}
"""Public name → the module that defines it."""

__all__ = ["Config", "Corrections", "HumanMMError", "Run", "__version__", "evaluate", "forecast", "load", "recover"]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module 'humanmm' has no attribute {name!r}")
    value = globals()[name] = getattr(importlib.import_module(_MODULES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
