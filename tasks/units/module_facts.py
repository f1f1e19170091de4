"""The facts of one module's source: a digest without its texts, its imports, and names of files.

Parsing all of our modules takes half a second, so the facts are cached by the sha256 of the source: a changed file has
another entry, and no entry is ever out of date.
"""

import ast
import contextlib
import functools
import hashlib
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from humanmm.storage.store.files import replace_file
from humanmm.storage.store.store import cache_folder

_MOST_ENTRIES = 2000
"""Older ones are dropped: sources that change leave their old entries behind."""


@dataclass(frozen=True)
class ModuleFacts:
    """One module's source."""

    digest: str
    imports: tuple[str, ...]
    """Absolute names, sorted; `from x import y` gives x and x.y."""
    strings: tuple[str, ...]
    """String constants that could name a weight file, sorted."""


class KnownModules:
    """Facts by source, cached in a file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._entries: dict[str, ModuleFacts] = {}
        self._is_changed = False
        with contextlib.suppress(OSError, ValueError, TypeError, AttributeError, KeyError):
            tree = json.loads(path.read_bytes())
            if tree["made_by"] == _reader_version():
                for key, (digest, imports, strings) in tree["modules"].items():
                    self._entries[key] = ModuleFacts(digest, tuple(imports), tuple(strings))

    def facts(self, source: bytes, package: str) -> ModuleFacts:
        """The facts of a source, as a module of this package."""
        key = hashlib.sha256(f"{package}\n".encode() + source).hexdigest()
        if key not in self._entries:
            self._entries[key] = read_module(source, package)
            self._is_changed = True
        return self._entries[key]

    def save(self) -> None:
        """Write new facts to the file; nothing is written to a folder that cannot be written."""
        if not self._is_changed:
            return
        self._is_changed = False
        newest = list(self._entries.items())[-_MOST_ENTRIES:]
        entries = {key: [facts.digest, facts.imports, facts.strings] for key, facts in newest}
        text = json.dumps({"made_by": _reader_version(), "modules": entries})

        def write(fresh: Path) -> None:
            fresh.write_text(text)

        with contextlib.suppress(OSError):
            replace_file(self._path, write)


@functools.lru_cache(maxsize=4)
def _known_modules(path: Path) -> KnownModules:
    return KnownModules(path)


def known_modules() -> KnownModules:
    """The facts in this user's cache folder."""
    return _known_modules(cache_folder() / "modules.json")


def _parsed(source: bytes) -> ast.Module:
    """The tree of some source. CPython 3.11 gets it wrong when two threads parse or import at once (gh-106905)."""
    for pause_s in (0.01, 0.1, 1.0):
        try:
            return ast.parse(source)
        except SystemError:
            time.sleep(pause_s)
    return ast.parse(source)


def read_module(source: bytes, package: str) -> ModuleFacts:
    """Parse one module of a package."""
    tree = _StripTexts().visit(_parsed(source))
    imports: set[str] = set()
    strings: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imports.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = _absolute(node, package)
            imports.add(base)
            imports.update(f"{base}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and _may_name_a_file(node.value):
            strings.add(node.value)
    digest = hashlib.sha256(ast.dump(tree, annotate_fields=False).encode()).hexdigest()
    return ModuleFacts(digest, tuple(sorted(imports)), tuple(sorted(strings)))


class _StripTexts(ast.NodeTransformer):
    """Removes docstrings and the strings that describe attributes: expressions that are nothing but a text."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            return None
        return node


def _may_name_a_file(text: str) -> bool:
    plain = 0 < len(text) < 100 and not set("/\0\n") & set(text)
    no_weights = ("", ".json", ".md", ".py", ".txt")  # manifest and licences change no number
    return plain and Path(text).suffix not in no_weights


def _absolute(node: ast.ImportFrom, package: str) -> str:
    if node.level == 0:
        return node.module or ""
    base = package.split(".")[: len(package.split(".")) - node.level + 1]
    return ".".join([*base, *([node.module] if node.module else [])])


@functools.cache
def _reader_version() -> str:
    """Python's version and the digest of this file: another one may find other facts in the same source."""
    return f"{sys.version_info[:3]} {hashlib.sha256(Path(__file__).read_bytes()).hexdigest()}"
