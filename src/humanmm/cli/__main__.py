"""`python -m humanmm.cli`: the same as the command `humanmm`."""

import sys

from humanmm.cli import main

if __name__ == "__main__":
    sys.exit(main())
