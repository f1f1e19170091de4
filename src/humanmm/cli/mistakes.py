"""What the user may have meant by a word that no command, flag, stage or format has."""

import difflib
import re
from collections.abc import Iterable, Sequence
from typing import Any

SHOWN = 3
LEAST, BEHIND_BEST = 0.65, 0.1
"""Likeness (difflib's ratio) of a word that may be meant, and how far it may lie behind that of the likeliest."""
SYNONYMS = {
    "gltf": "glb", "smpl": "amass", "smplx": "amass", "npz": "amass", "opensim": "trc", "pt": "gvhmr", "usda": "usd",
    "usdz": "usd", "usdc": "usd", "bpy": "blender", "fov": "--fov-deg", "output": "--out", "device": "--run.threads",
    "hmr2": "hmr", "pose": "people", "detect": "people", "render": "view", "run": "recover", "evaluate": "eval",
}  # fmt: skip
"""What other programs call it → what it is called here."""


def usage_message(error: Any, program: str) -> str:
    """An error of Typer in one sentence, with the word that was probably meant, and where help is."""
    context = getattr(error, "ctx", None)
    message = _without_suggestion(error)
    meant = _meant(error, context, message)
    where = context.command_path if context else program
    hint = f" Did you mean {_either(meant)}?" if meant else ""
    return f"{message}{'' if message.endswith(('.', '?')) else '.'}{hint} (see `{where} --help`)"


def close_words(word: str, known: Iterable[str]) -> list[str]:
    """Those of some words that are likely to be meant by one: spelled alike, in whole or in a part, or its synonym."""
    words = list(dict.fromkeys(known))
    synonym = SYNONYMS.get(_plain(word))
    likeness = {one: 1.0 if one == synonym else _likeness(_plain(word), _plain(one)) for one in words}
    least = max([LEAST, *(value - BEHIND_BEST for value in likeness.values())])
    return sorted((one for one in words if likeness[one] >= least), key=lambda one: (-likeness[one], len(one)))[:SHOWN]


def _plain(word: str) -> str:
    return word.lstrip("-").replace("-", "_").lower()


def _likeness(word: str, known: str) -> float:
    """0..1; `camera.static` is as like `static` as a word is itself, and `cam` nearly as like `camera`."""
    parts = [known, *known.split(".")[1:], *(part for part in known.split("_") if len(part) > 2)]
    alike = max(difflib.SequenceMatcher(None, word, part).ratio() for part in parts)
    return max(alike, 0.9) if len(word) > 1 and known.startswith(word) else alike


def _without_suggestion(error: Any) -> str:
    """The message as it is without Typer's own suggestions, which name flags that are alike in one letter."""
    name = getattr(error, "option_name", None)
    text = f"No such option: {name}" if name is not None and hasattr(error, "possibilities") else error.format_message()
    text = re.sub(r" Did you mean [^?]*\?", "", text)
    return text.replace("Value error, ", "")  # pydantic's, which checks choices for Typer


def _meant(error: Any, context: Any, message: str) -> Sequence[str]:
    if context is None:
        return []
    if getattr(error, "option_name", None) is not None:
        flags = [flag for parameter in context.command.params for flag in parameter.opts if flag.startswith("--")]
        return close_words(error.option_name, flags)
    command = re.match(r"No such command '(.*)'", message)
    if command:
        return close_words(command[1], getattr(context.command, "commands", {}))
    choice = re.search(r"'([^']*)' is not one of (.*)", message)
    return close_words(choice[1], re.findall(r"'([^']*)'", choice[2])) if choice else []


def _either(words: Sequence[str]) -> str:
    quoted = [f"'{word}'" for word in words]
    return " or ".join([", ".join(quoted[:-1]), quoted[-1]] if len(quoted) > 1 else quoted)
