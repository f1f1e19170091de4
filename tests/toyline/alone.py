"""The toy's whole pipeline without Prefect, in a process of its own: `python -m toyline.alone VIDEO STORE [STAGE]`.

With STAGE the process prints `writing` and hangs while it writes that stage's artifact, so that it can be killed there.
"""

import sys
import time
from pathlib import Path

from humanmm.config import Config
from humanmm.storage.store import artifact
from humanmm.storage.store.identity import identify
from humanmm.storage.store.open import open_store
from humanmm.tasks.engine.run import VideoRun
from toyline.table import STAGES


def _hang(folder: Path) -> None:
    sys.stdout.write("writing\n")
    sys.stdout.flush()
    time.sleep(120)


def main() -> None:
    video, root, *hanging = sys.argv[1:]
    store = open_store(root)
    run = VideoRun(identify(Path(video), store), Config(), store, stages=STAGES)
    for stage in STAGES:
        if stage.name in hanging:
            artifact._sync = _hang
        for unit in run.units(stage) or ():
            run.execute(unit)


if __name__ == "__main__":
    main()
