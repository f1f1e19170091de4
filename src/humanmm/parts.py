"""The replaceable parts of the pipeline, by name: which there are, and where their code is.

A part is a function (or any object that can be called) chosen by one setting, for instance `people.pose`. Other
packages add parts by entry points: the group is `humanmm.` and the setting's name, the entry's name is the setting's
value. docs/extend.md lists the Protocol of each. Importing this module imports no part.
"""

import difflib
import importlib.metadata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from humanmm.errors import ConfigError

BUILT_IN: Mapping[str, Mapping[str, str]] = {
    "people.detector": {"movenet-multipose": "humanmm.models.perception.movenet:detect"},
    "people.pose": {
        "best": "humanmm.models.perception.keypoints.fusion:locate_best",
        "fast": "humanmm.models.perception.keypoints.fusion:locate_best",
        "blazepose-heavy": "humanmm.models.perception.blazepose:locate_heavy",
        "blazepose-full": "humanmm.models.perception.blazepose:locate_full",
    },
    "points.tracker": {"klt": "humanmm.models.camera.klt:klt_tracks"},
    "lifting.method": {
        "transformer": "humanmm.models.perception.lifting.lift:lift",
        "none": "humanmm.models.perception.lifting.lifted:keep",
    },
    "lifting.keypoints": {"transformer": "humanmm.models.perception.lifting.keypoints:lift_keypoints"},
    "camera.estimator": {"bundle": "humanmm.models.camera.estimate:camera_from_points"},
    "hmr.initial_pose": {"inverse-kinematics": "humanmm.models.motion.fit.initial:start_pose"},
    "align.method": {
        "bundle": "humanmm.models.cuts.camera_rotation:align_by_bundle",
        "eight-point": "humanmm.models.cuts.camera_rotation:align_by_eight_point",
    },
    "refine.networks": {
        "trajectory": "humanmm.models.motion.networks.integrate:trajectory",
        "all": "humanmm.models.motion.networks.integrate:all_networks",
        "none": "humanmm.models.motion.networks.interfaces:nothing",
    },
}
"""Setting → name → module:attribute."""


@dataclass(frozen=True)
class Part:
    """Where one part is."""

    setting: str
    name: str
    module: str
    attribute: str
    distribution: str | None = None
    """The installed distribution that brings it; None if it is our own."""
    version: str = ""


def find(setting: str, name: str) -> Part:
    """The part that a setting names; ConfigError lists those that there are."""
    part = _built_in(setting).get(name) or _installed(setting).get(name)
    if part is None:
        known = sorted({**_built_in(setting), **_installed(setting)})
        close = difflib.get_close_matches(name, known, n=1)
        meant = f"did you mean {close[0]!r}? " if close else ""
        installed = f"installed are: {', '.join(known)} (docs/extend.md adds others)"
        raise ConfigError(f"{setting} has no part called {name!r}; {meant}{installed}")
    return part


def load(setting: str, name: str) -> Any:
    """The part itself; ConfigError if its package cannot be imported."""
    part = find(setting, name)
    try:
        return getattr(import_module(part.module), part.attribute)
    except (ImportError, AttributeError) as error:
        origin = f"{part.distribution} {part.version}" if part.distribution else "humanmm"
        raise ConfigError(f"{setting} = {name!r} of {origin} cannot be loaded: {error}; install it again") from error


def chosen(settings: Any, sections: Iterable[str]) -> tuple[Part, ...]:
    """The parts that these sections of a configuration name, in the order of BUILT_IN."""
    wanted = set(sections)
    return tuple(
        find(setting, getattr(getattr(settings, section), field))
        for setting in BUILT_IN
        for section, _, field in [setting.partition(".")]
        if section in wanted
    )


def every() -> list[Part]:
    """All parts that can be named here, ours first."""
    return [part for setting in BUILT_IN for part in (*_built_in(setting).values(), *_installed(setting).values())]


def _built_in(setting: str) -> dict[str, Part]:
    return {name: Part(setting, name, *where.split(":")) for name, where in BUILT_IN[setting].items()}


def _installed(setting: str) -> dict[str, Part]:
    """What other packages add; they cannot replace ours."""
    return {
        entry.name: Part(setting, entry.name, entry.module, entry.attr, entry.dist.name, entry.dist.version)
        for entry in importlib.metadata.entry_points(group=f"humanmm.{setting}")
        if entry.dist is not None and entry.name not in BUILT_IN[setting]
    }
