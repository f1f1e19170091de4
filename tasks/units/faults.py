"""What an error of a stage means: whether a retry may help, whether it ends the run, and its message."""

import pickle

from humanmm.errors import HumanMMError, InputError, ResourceError, StageError, StoreError, WeightsError


def is_infrastructure_fault(error: BaseException) -> bool:
    """True for faults that may pass: store, disk, network, memory, a lost process. Bad input and failed stages never
    do."""
    if isinstance(error, StoreError | ResourceError) or _is_parser_race(error):
        return True
    lasting = (FileNotFoundError, NotADirectoryError, IsADirectoryError, PermissionError)
    return isinstance(error, OSError) and not isinstance(error, lasting)


def ran_out_of_memory(error: BaseException) -> bool:
    """True if main memory or an accelerator's was too small for what ran at that time."""
    kind = type(error)  # torch is not imported for this: its error is known by its name
    return isinstance(error, MemoryError) or (kind.__name__, kind.__module__.split(".")[0]) == (
        "OutOfMemoryError",
        "torch",
    )


def _is_parser_race(error: BaseException) -> bool:
    """CPython 3.11 compiling modules in two threads at once (gh-106905): at the next attempt they are compiled."""
    return isinstance(error, SystemError) and "AST constructor" in str(error)


def ends_run(error: BaseException) -> bool:
    """True for errors that no other shot can escape: the user's input, the weight files."""
    return isinstance(error, InputError | WeightsError)


def as_ours(error: Exception, label: str) -> HumanMMError:
    """The error as one of `humanmm.errors`; one that is neither ours nor of the infrastructure is a defect of the
    stage."""
    if isinstance(error, HumanMMError):
        return error
    if ran_out_of_memory(error):
        device = "the accelerator's memory" if type(error).__name__ == "OutOfMemoryError" else "memory"
        return ResourceError(f"{label}: {device} ran out ({in_words(error)}); fewer --run.threads need less")
    if _is_parser_race(error):
        return ResourceError(f"{label}: {error}")
    if is_infrastructure_fault(error):
        return StoreError(f"{label}: {error}")
    return StageError(f"{label} failed unexpectedly: {type(error).__name__}: {error} (-v shows where)")


def portable(error: Exception, label: str) -> HumanMMError:
    """The same, in a form that another process can unpickle and raise."""
    ours = as_ours(error, label)
    try:
        pickle.loads(pickle.dumps(ours))
    except Exception:
        return StageError(str(ours))
    return ours


def in_words(error: BaseException) -> str:
    """The message in one line; the class of the error if it has none."""
    return " ".join(str(error).split()) or type(error).__name__
