"""The command line. Exit status: 0 done, 1 our error, 2 usage, 3 partial. The last line on standard output is the result.

Nothing heavy is imported before it is needed: an unchanged rerun is answered by the store in a second.
"""

import argparse
import logging
import os
import sys
from collections.abc import Sequence

from humanmm import __version__
from humanmm.cli import bench, inspect, maintain, recover, results
from humanmm.cli.settings import UsageError
from humanmm.errors import HumanMMError

_VERBS = (recover.add_recover, inspect.add_status, inspect.add_explain, *results.VERBS, bench.add_bench, *maintain.VERBS)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit status."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # many small tensors: one thread each, stages run side by side
    options = _parser().parse_args(arguments)
    _set_up_log(verbose=options.verbose)
    try:
        return int(options.run(options))
    except UsageError as error:
        return _tell(error, 2)
    except HumanMMError as error:
        if options.verbose:
            logging.getLogger(__name__).error("", exc_info=error)
        return _tell(error, 1)
    except BrokenPipeError:  # the reader of our output has left
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        return _tell("interrupted; what was computed stays in the store", 130)
    except Exception as error:
        if options.verbose:
            logging.getLogger(__name__).error("", exc_info=error)
        return _tell(f"unexpected {type(error).__name__}: {error} (-v shows where)", 1)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="humanmm",
        description="One continuous human motion in one metric world, with the cameras, from a video with cuts.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"humanmm {__version__}")
    verbs = parser.add_subparsers(required=True, metavar="VERB", title="verbs")
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("-v", "--verbose", action="store_true", help="tell every step, and where an error came from")
    for add in _VERBS:
        add(verbs, common)
    return parser


def _set_up_log(*, verbose: bool) -> None:
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(levelname)s %(name)s: %(message)s" if verbose else "humanmm: %(message)s"))
    handler.setLevel(logging.DEBUG if verbose else logging.WARNING)
    logger = logging.getLogger("humanmm")
    logger.handlers = [handler]
    logger.setLevel(logging.INFO)
    logger.propagate = False


def _tell(error: object, status: int) -> int:
    """One or two plain lines on standard error, whatever characters the message has."""
    text = " ".join(str(error).split())
    sys.stderr.write(f"humanmm: {text.encode('utf-8', 'backslashreplace').decode()}\n")
    return status
