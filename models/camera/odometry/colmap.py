"""pycolmap without its handler of SIGTERM: `from humanmm.models.camera.odometry.colmap import pycolmap`.

Its logging takes that signal while it is imported, and from then on ends the process with a stack trace: nothing else
could note any more that a run received it. Python neither knows of such a handler nor sets one outside its main
thread, hence C's own way.
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

__all__ = ["pycolmap"]
