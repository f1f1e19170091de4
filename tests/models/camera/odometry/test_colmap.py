"""pycolmap leaves the signals of the process alone."""

import signal
import subprocess
import sys

SCRIPT = """
import os, signal, threading
signal.signal(signal.SIGTERM, lambda number, frame: print("told", flush=True))
importing = threading.Thread(target=lambda: __import__("humanmm.models.camera.odometry.colmap"))
importing.start()
importing.join()
os.kill(os.getpid(), signal.SIGTERM)
signal.signal(signal.SIGTERM, signal.SIG_DFL)
os.kill(os.getpid(), signal.SIGTERM)
"""


def test_a_process_that_has_imported_it_is_reported_of_sigterm_as_before() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr, done.returncode) == ("told\n", "", -signal.SIGTERM)
