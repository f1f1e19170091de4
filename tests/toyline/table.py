"""The real table of stages with the toy's functions."""

from dataclasses import replace

from humanmm.tasks import pipeline

STAGES = tuple(replace(stage, module=f"toyline.{stage.name}") for stage in pipeline.STAGES)
