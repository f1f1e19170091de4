"""Prefect's process worker for `humanmm serve`: `python -m humanmm.flows.worker POOL LIMIT NAME`.

It leaves when its standard input ends, which it does when `humanmm serve` ends, however that came about.
"""

import os
import runpy
import signal
import sys
import threading


def main(pool: str, limit: str, name: str) -> None:
    """Work until told to stop or until standard input ends."""
    threading.Thread(target=_leave_at_end_of_input, daemon=True).start()
    sys.argv = ["prefect", "worker", "start", "--type", "process", "--pool", pool, "--limit", limit, "--name", name]
    runpy.run_module("prefect", run_name="__main__")


def _leave_at_end_of_input() -> None:
    sys.stdin.buffer.read()
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    main(*sys.argv[1:])
