"""Every error humanmm raises on purpose.

    HumanMMError
    ├── InputError             the user's file, flag or setting is wrong: never retried
    │   ├── VideoError         not a video, nothing decodes, a claim in the header is absurd
    │   ├── UsageError         arguments or flags contradict each other
    │   ├── ConfigError        unknown key, value out of range
    │   ├── NoUsablePersonError   nobody in the video can be recovered
    │   └── TruthError         a truth file lacks what an evaluation needs
    ├── StageError             a stage could not do its work on this input: never retried
    │   ├── MissingInputError  an artifact that the stage reads is not in the store
    │   └── TimeLimitError     a stage took longer than the user allows
    ├── StoreError             an artifact is damaged, the disk is full, a lock was lost: retried with back-off
    ├── ResourceError          memory ran out, a process was lost: retried with back-off
    └── WeightsError           a shipped weight file does not match its manifest

A message says what was wrong (with the value), what was expected, and what to do.
"""


class HumanMMError(Exception):
    """Base of all errors that are reported in plain words, without a traceback."""


class InputError(HumanMMError):
    """The user's file, flag or setting is wrong; trying again cannot help."""


class VideoError(InputError):
    """The video cannot be read."""


class UsageError(InputError):
    """Arguments or flags are wrong together: exit status 2 on the command line."""


class ConfigError(InputError):
    """A configuration key is unknown or its value is out of range."""


class NoUsablePersonError(InputError):
    """Nobody in the video can be recovered."""


class TruthError(InputError):
    """A truth file or run folder lacks what an evaluation needs."""


class StageError(HumanMMError):
    """A stage could not do its work on this input."""


class MissingInputError(StageError):
    """An artifact that the stage reads is not in the store."""


class TimeLimitError(StageError):
    """A stage took longer than the user allows; it would again."""


class StoreError(HumanMMError):
    """The artifact store failed: damage, a full disk, a lost lock. Worth another try."""


class ResourceError(HumanMMError):
    """Memory ran out or a process was lost. Worth another try."""


class WeightsError(HumanMMError):
    """A weight file does not match its manifest."""
