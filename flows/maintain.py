"""Maintenance of the store as a flow, for the dashboard and for schedules: verify artifacts, remove unused ones."""

from pathlib import Path
from typing import Any

from prefect import flow
from prefect.states import Completed, Failed

from humanmm.storage.store import maintenance
from humanmm.storage.store.open import open_store
from humanmm.tasks import pipeline


@flow(name="maintain", persist_result=False)
def maintain(
    store: Path | None = None,
    deep: bool = False,
    unused_days: float = 30.0,
    with_runs: bool = False,
    remove: bool = False,
) -> Any:
    """Verify the store; list artifacts unused for this many days, and delete them with `remove`. Fails on damage.

    The artifacts of the last run on a video stay, unless `with_runs`.
    """
    artifacts = open_store(store)
    findings = list(maintenance.verify(artifacts, outputs=pipeline.outputs(), deep=deep))
    damaged = [finding for finding in findings if finding.problem]
    items = maintenance.removable(artifacts, unused_days=unused_days, with_runs=with_runs)
    if remove:
        freed = f"{maintenance.in_bytes(maintenance.remove(artifacts, items))} freed"
    else:
        freed = f"{maintenance.in_bytes(sum(item.num_bytes for item in items))} could go"
    summary = f"{len(findings) - len(damaged)} artifacts are sound, {len(damaged)} damaged; {freed}"
    if damaged:
        return Failed(message=summary + "; " + "; ".join(f"{f.uri}: {f.problem}" for f in damaged[:10]))
    return Completed(message=summary)
