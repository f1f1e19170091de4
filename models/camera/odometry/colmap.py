"""pycolmap without its handler of SIGTERM, and quiet: `from humanmm.models.camera.odometry.colmap import pycolmap`.

Its logging takes that signal while it is imported, and from then on ends the process with a stack trace: nothing else
could note any more that a run received it. Python neither knows of such a handler nor sets one outside its main
thread, hence C's own way. Ceres warns of every step that it takes back; whether a solve ended well is in its result.
"""

import ctypes
import signal

_SIGACTION_BYTES = 256
"""More than C's `struct sigaction` has anywhere."""

_sigaction = getattr(ctypes.CDLL(None), "sigaction", None)
_before = ctypes.create_string_buffer(_SIGACTION_BYTES)
if _sigaction is not None:
    _sigaction(signal.SIGTERM, None, _before)

import pycolmap  # noqa: E402

if _sigaction is not None:
    _sigaction(signal.SIGTERM, _before, None)

pycolmap.logging.minloglevel = int(pycolmap.logging.ERROR)

__all__ = ["pycolmap"]
