"""The signals that ask a process to stop. It loads no library: the command line needs it before any is loaded."""

import signal

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1)
"""Ctrl-C; what stops a service; a terminal that is closed; Ctrl-\\; a batch system's warning that the time is up."""
