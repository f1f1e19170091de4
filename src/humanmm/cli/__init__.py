"""The command line. Exit status: 0 done, 1 our error, 2 usage, 3 partial. The last line on stdout is the result.

Nothing heavy is imported before it is needed: an unchanged rerun is answered by the store in a second.
"""

import argparse
import logging
import os
import sys
from collections.abc import Sequence

from humanmm import __version__
from humanmm.errors import HumanMMError
from humanmm.logs import to_standard_error


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit status."""
    for library in ("OMP", "OPENBLAS", "MKL"):  # small tensors, stages side by side: one thread each; before numpy
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    from humanmm.cli.settings import UsageError

    options = _parser().parse_args(arguments)
    to_standard_error(verbose=options.verbose)
    try:
        return int(options.run(options))
    except UsageError as error:
        return _tell(error, 2, verbose=options.verbose)
    except HumanMMError as error:
        return _tell(error, 1, verbose=options.verbose)
    except BrokenPipeError:  # the reader of our output has left
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt as error:
        return _tell(error, 130, verbose=options.verbose, words="interrupted; what was computed stays in the store")
    except Exception as error:
        words = f"unexpected {type(error).__name__}: {error} (-v shows where)"
        return _tell(error, 1, verbose=options.verbose, words=words)


def _parser() -> argparse.ArgumentParser:
    from humanmm.cli import batch, bench, dataset, doctor, inspect, maintain, recover, results, serve

    parser = argparse.ArgumentParser(
        prog="humanmm",
        description="One continuous human motion in one metric world, with the cameras, from a video with cuts.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"humanmm {__version__}")
    verbs = parser.add_subparsers(required=True, metavar="VERB", title="verbs")
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("-v", "--verbose", action="store_true", help="tell every step, and where an error came from")
    groups = (recover, batch, serve, results, inspect, bench, dataset, maintain, doctor)
    for add in (add for group in groups for add in group.VERBS):
        add(verbs, common)
    return parser


def _tell(error: BaseException, status: int, *, verbose: bool, words: str = "") -> int:
    """One plain line on standard error, whatever characters the message has; the traceback before it with -v."""
    if verbose:
        logging.getLogger(__name__).error("where it happened", exc_info=error)
    text = " ".join((words or str(error)).split())
    sys.stderr.write(f"humanmm: {text.encode('utf-8', 'backslashreplace').decode()}\n")
    return status
