"""Everything that decides one stage's result on one unit, and its key in the store.

Equal keys mean equal results. The recipe is stored beside its artifact, so that a recompute can say which part of it
changed.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from humanmm.storage.store.codec import Json, canonical_json

KEY_VERSION = 1
"""Part of every key; raised when the meaning of a recipe changes."""


@dataclass(frozen=True)
class Recipe:
    """Everything that goes into one result, as json values."""

    stage: str
    schema_version: int
    unit: Mapping[str, Json]
    """Parameters of the unit, e.g. first and last frame; empty for a stage per video."""
    modules: Mapping[str, str]
    """Module → digest of its code."""
    weights: Mapping[str, str]
    """Weight file → sha256."""
    libraries: Mapping[str, str]
    """Library (and Python) → version."""
    settings: Mapping[str, Mapping[str, Json]]
    """Section of the configuration → its values."""
    inputs: Mapping[str, str]
    """Input → content digest, or `failed`."""

    @property
    def key(self) -> str:
        """64 hex digits: the address of the result."""
        return hashlib.sha256(canonical_json([KEY_VERSION, self.to_json()]).encode()).hexdigest()

    def to_json(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @classmethod
    def from_json(cls, tree: Mapping[str, Any]) -> "Recipe":
        return cls(**{field.name: tree[field.name] for field in fields(cls)})

    def changes_since(self, older: "Recipe") -> list[str]:
        """One sentence per part that differs, causes before consequences."""
        sentences = []
        if self.schema_version != older.schema_version:
            sentences.append(f"schema changed: version {older.schema_version} → {self.schema_version}")
        sentences += _each("code changed", older.modules, self.modules, show=False)
        sentences += _each("weight file changed", older.weights, self.weights, show=False)
        sentences += _each("version changed", older.libraries, self.libraries, show=True)
        sentences += _each("setting changed", _flat(older.settings), _flat(self.settings), show=True)
        sentences += _each("unit changed", older.unit, self.unit, show=True)
        sentences += _each("input changed", older.inputs, self.inputs, show=False)
        return sentences


def _each(what: str, older: Mapping[str, Any], newer: Mapping[str, Any], *, show: bool) -> list[str]:
    names = [name for name in sorted({*older, *newer}) if older.get(name) != newer.get(name)]
    if not show:
        return [f"{what}: {', '.join(names)}"] if names else []
    return [f"{what}: {name} {_show(older, name)} → {_show(newer, name)}" for name in names]


def _show(values: Mapping[str, Any], name: str) -> str:
    return str(values[name]) if name in values else "(absent)"


def _flat(settings: Mapping[str, Mapping[str, Json]]) -> dict[str, Json]:
    return {f"{section}.{name}": value for section, values in settings.items() for name, value in values.items()}
