"""Container facts and streaming frames of a video (PyAV)."""
