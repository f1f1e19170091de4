"""`humanmm eval`: one run (or take) against its truth."""

from pathlib import Path

from humanmm.models.evaluation.evaluate import evaluate
from humanmm.models.evaluation.report import Report
from humanmm.storage.truth import read_take


def evaluate_run(run_dir: Path, truth: Path) -> Report:
    """Every figure of `eval --json`. Both may be a run folder or an npz; raises TruthError, with one sentence."""
    return evaluate(read_take(run_dir), read_take(truth))
