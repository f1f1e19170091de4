"""Which module of humanmm imports which, read from the sources: lazy and TYPE_CHECKING imports count as any other."""

import ast
import functools
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "src" / "humanmm"
Graph = Mapping[str, frozenset[str]]


@functools.cache
def modules() -> Mapping[str, Path]:
    """Module → file. Names are dotted, without `humanmm.`; a package has that of its folder, humanmm itself none."""
    found = {}
    for path in _sources(PACKAGE):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


BASE = frozenset(
    {"config", "config_reading", "corrections", "errors", "logs", "machine", "parts", "signals", "version"}
)
"""Files of `src/humanmm` that every layer may import; the other files there are the Python API, above all layers."""


def room_of(module: str) -> str:
    """The folder that a module lies in; a package lies in itself, a file of `src/humanmm` is a room of its own."""
    if "." not in module or modules()[module].name == "__init__.py":
        return module
    return module.rpartition(".")[0]


def packages() -> set[str]:
    """The rooms that are folders."""
    return {name for name, path in modules().items() if path.name == "__init__.py"} - {""}


@functools.cache
def imports() -> Graph:
    """Module → the modules that it imports. `from room import module` imports the module."""
    return {name: frozenset(_imports_of(name)) for name in modules()}


def rooms() -> Graph:
    """Room → the other rooms that its modules import."""
    graph: dict[str, set[str]] = {}
    for module, imported in imports().items():
        room = room_of(module)
        graph.setdefault(room, set()).update({room_of(other) for other in imported} - {room})
    return {room: frozenset(others) for room, others in graph.items()}


def circles(graph: Graph) -> set[frozenset[str]]:
    """The largest sets of nodes that all reach one another."""
    reach = {node: reachable(graph, node) for node in graph}
    return {
        frozenset({node, *(other for other in reach[node] if node in reach[other])})
        for node in graph
        if node in reach[node]
    }


def reachable(graph: Graph, start: str) -> set[str]:
    """All nodes that one node imports, directly or not."""
    found: set[str] = set()
    waiting = [start]
    while waiting:
        new = graph[waiting.pop()] - found
        found |= new
        waiting += new
    return found


def without_detours(graph: Graph) -> Graph:
    """The same graph without the arrows that follow from others: its transitive reduction; circles stay as they are."""
    reach = {node: reachable(graph, node) for node in graph}

    def follows(a: str, b: str) -> bool:
        between = (c for c in graph[a] if c != b and a not in reach[c] and c not in reach[b])
        return any(b in reach[c] for c in between)

    return {a: frozenset(b for b in graph[a] if not follows(a, b)) for a in graph}


def _sources(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.iterdir()):
        if path.is_dir() and (path / "__init__.py").is_file():  # the links to the rooms at the root, too
            yield from _sources(path)
        elif path.suffix == ".py":
            yield path


def _imports_of(name: str) -> Iterator[str]:
    path = modules()[name]
    for node in ast.walk(ast.parse(path.read_bytes())):
        assert not getattr(node, "level", 0), f"{path} has a relative import"
        yield from (imported for imported in imported_by(node) if imported != name)


def imported_by(node: ast.AST) -> Iterator[str]:
    """Those of our modules that a statement imports by their whole names."""
    if isinstance(node, ast.Import):
        named = [alias.name for alias in node.names]
    elif isinstance(node, ast.ImportFrom) and not node.level:
        whole = [f"{node.module}.{alias.name}" for alias in node.names]
        named = [each if _short(each) in modules() else str(node.module) for each in whole]
    else:
        return
    yield from (short for each in named if (short := _short(each)) in modules())


def _short(name: str) -> str | None:
    """The name of one of our modules without `humanmm.`; None for a module of somebody else."""
    root, _, rest = name.partition(".")
    return rest if root == "humanmm" else None
