"""The code that a stage's result depends on, found without importing any of it.

Starting at the stage's module, its imports are followed by reading the syntax trees. Of our own package the folder
models/, the files tasks/*.py, the readers of files and the modules that write pictures and videos count; the rest
decides when a result is computed, never what it is, or stands in the key by its values (config). A module's digest
(`module_facts`) leaves out comments, docstrings and line numbers, so that a reworded text recomputes nothing. Weight
files count when a visited module names them; numerical libraries count by version when a visited module imports them.

Replaceable parts (`humanmm.parts`) are loaded by name, which no import shows: those that the configuration names are
visited too, and an external one counts by its distribution's version and the files beside its code as well.
"""

import functools
import importlib.metadata
import importlib.util
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from humanmm.parts import Part
from humanmm.storage.store.files import file_sha256
from humanmm.tasks.units.module_facts import known_modules

PACKAGE = "humanmm"
_READERS = Path("storage/readers")
"""Read what users give along with a video."""
_WRITES_ARTIFACTS = (Path("storage/run_folder/picture_files.py"), Path("storage/view/embedded_video.py"))
"""Write pictures and videos that are part of an artifact."""

_DISTRIBUTIONS = {
    "numpy": ("numpy",),
    "scipy": ("scipy",),
    "torch": ("torch",),
    "cv2": ("opencv-python-headless", "opencv-python"),
    "av": ("av",),
    "pycolmap": ("pycolmap",),
    "ai_edge_litert": ("ai-edge-litert",),
    "matplotlib": ("matplotlib",),
    "transformers": ("transformers",),
}
"""Import name → distributions that may provide it, of the libraries whose version can change a number."""


@dataclass(frozen=True)
class CodeDigest:
    """All code of one stage: module → digest, weight file → sha256, library → version."""

    modules: dict[str, str]
    weights: dict[str, str]
    libraries: dict[str, str]


def code_digest(module: str, parts: Iterable[Part] = (), *, weights_dir: Path | None = None) -> CodeDigest:
    """Digest of a stage's module, of the parts that are chosen for it, and of all of their packages that these import,
    directly or not."""
    weights_dir = weights_dir or _location_of(PACKAGE) / "models" / "weights"
    if _source_of(module) is None:
        raise ModuleNotFoundError(f"there is no module {module}")
    known, package = known_modules(), _location_of(PACKAGE)
    parts = tuple(parts)
    waiting, modules, weights = [module, *(part.module for part in parts)], {}, {}
    roots = {PACKAGE, *(name.split(".")[0] for name in waiting)}
    libraries = {"python": "{}.{}".format(*sys.version_info)}
    libraries |= {part.distribution: part.version for part in parts if part.distribution}
    foreign = {part.module.split(".")[0] for part in parts if part.distribution}
    visited: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name in visited:
            continue
        visited.add(name)
        path = _source_of(name)
        if path is None or not _decides_results(path, package):
            continue
        facts = known.facts(path.read_bytes(), name if path.name == "__init__.py" else name.rpartition(".")[0])
        modules[name] = facts.digest
        for imported in facts.imports:
            root = imported.split(".")[0]
            if root in roots:
                waiting += _with_parents(imported)
            elif root in _DISTRIBUTIONS:
                libraries[root] = _version(root)
        folder = path.parent if name.split(".")[0] in foreign else weights_dir
        for text in facts.strings:
            if (folder / text).is_file():
                weights[text] = _file_sha256(folder / text, (folder / text).stat().st_mtime_ns)
    known.save()
    return CodeDigest(dict(sorted(modules.items())), dict(sorted(weights.items())), dict(sorted(libraries.items())))


def _with_parents(name: str) -> list[str]:
    parts = name.split(".")
    return [".".join(parts[: i + 1]) for i in range(1, len(parts))]


def _decides_results(path: Path, package: Path) -> bool:
    if not path.is_relative_to(package):  # a stage of another package
        return True
    inner = path.relative_to(package)
    science = inner.parts[0] == "models" or inner.parent == Path("tasks")
    return science or inner.is_relative_to(_READERS) or inner in _WRITES_ARTIFACTS


def _source_of(name: str) -> Path | None:
    """The file of a module; None for a name that is no module, such as a function imported from one."""
    root, *rest = name.split(".")
    base = _location_of(root)
    if base.is_file():
        return None if rest else base
    base = base.joinpath(*rest)
    if (base / "__init__.py").is_file():
        return base / "__init__.py"
    path = base.with_name(f"{base.name}.py")
    return path if rest and path.is_file() else None


def _location_of(root: str) -> Path:
    """The folder of a package, or the file of a module that is none."""
    spec = importlib.util.find_spec(root)
    if spec is not None and spec.submodule_search_locations:
        return Path(next(iter(spec.submodule_search_locations)))
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(f"no package named {root!r}")
    return Path(spec.origin)


@functools.cache
def _version(root: str) -> str:
    for distribution in _DISTRIBUTIONS[root]:
        try:
            return importlib.metadata.version(distribution)
        except importlib.metadata.PackageNotFoundError:
            continue
    return "not installed"


@functools.lru_cache(maxsize=64)
def _file_sha256(path: Path, changed_ns: int) -> str:
    """sha256 of a file that several stages name; `changed_ns` is when it was last changed."""
    return file_sha256(path)
