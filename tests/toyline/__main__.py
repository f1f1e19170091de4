"""The command `humanmm` with the toy's stages, for tests that need a process of its own."""

import sys

from humanmm.cli import main
from humanmm.tasks import pipeline
from toyline.table import STAGES

if __name__ == "__main__":
    pipeline.STAGES = STAGES
    sys.exit(main())
