"""What a unit's key is made of: code, weights, libraries, settings, and the content of everything that it reads.

Equal keys mean equal results; nothing else may influence a result (`humanmm.tasks.units.inputs` enforces that).
"""

import threading

from humanmm.config import Config
from humanmm.corrections import Corrections
from humanmm.errors import MissingInputError
from humanmm.models.records.shots import ShotList
from humanmm.parts import chosen
from humanmm.storage.store.codec import Json, encode
from humanmm.storage.store.identity import VideoIdentity
from humanmm.storage.store.recipe import Recipe
from humanmm.tasks.pipeline import Stage
from humanmm.tasks.units.artifacts import Artifacts
from humanmm.tasks.units.digest import CodeDigest, code_digest
from humanmm.tasks.units.unit import Unit, seen_shot_list


def corrections_of(config: Config, unit: Unit) -> Corrections:
    """The user's corrections that concern a unit."""
    return config.corrections.chosen(unit.stage.corrections, unit.span if unit.stage.per == "shot" else None)


class Keys:
    """Makes the recipes of one video's units, from which their keys are computed."""

    def __init__(self, video: VideoIdentity, config: Config, artifacts: Artifacts) -> None:
        self._video = video
        self._config = config
        self._artifacts = artifacts
        self._code: dict[str, CodeDigest] = {}
        self._code_lock = threading.Lock()

    def code(self, stage: Stage) -> CodeDigest:
        """The code of a stage as it was at the first call: a run sees one state of the code."""
        with self._code_lock:  # CPython 3.11 fails now and then when two threads parse at once (gh-106905)
            if stage.name not in self._code:
                self._code[stage.name] = code_digest(stage.function[0], chosen(self._config, stage.settings))
            return self._code[stage.name]

    def recipe(self, unit: Unit) -> Recipe:
        """Everything that decides a unit's result; MissingInputError names an artifact that is not there yet."""
        stage = unit.stage
        code = self.code(stage)
        return Recipe(
            stage=stage.name,
            schema_version=stage.schema_version,
            unit=unit.parameters,
            modules=code.modules,
            weights=code.weights,
            libraries=code.libraries,
            settings=self._settings(unit),
            inputs=self._input_digests(unit),
        )

    def _settings(self, unit: Unit) -> dict[str, dict[str, Json]]:
        """Section → its values; the corrections that concern the unit are one, if there are any."""
        found = {name: getattr(self._config, name).facts for name in unit.stage.settings}
        corrections = corrections_of(self._config, unit).facts
        return found | ({"corrections": corrections} if corrections else {})

    def _input_digests(self, unit: Unit) -> dict[str, str]:
        digests = {"video": self._video.sha256} if unit.stage.reads_video else {}
        for name in unit.stage.inputs:
            source = self._artifacts.stage(name)
            if source.defines == "shot":
                digests["shot" if unit.stage.per == "shot" else name] = self._shot_digest(unit)
                continue
            if source.defines == unit.stage.per:
                continue  # a scene is its frames, which stand in `unit`
            for needed in self._artifacts.inputs_of(unit, source):
                label = needed.label if unit.stage.per == "video" else name
                digests[label] = self._digest(needed)
        return digests

    def _digest(self, needed: Unit) -> str:
        outcome = self._artifacts.outcomes.get(needed.id)
        if outcome is None:
            raise MissingInputError(f"the artifact of {needed.label} is not in the store")
        return outcome.manifest.digest if outcome.manifest else "failed"

    def _shot_digest(self, unit: Unit) -> str:
        shots = self._artifacts.definition("shot", ShotList)
        if shots is None:
            raise MissingInputError("the list of shots is not in the store")
        return encode(seen_shot_list(shots, unit), ShotList).digest()
