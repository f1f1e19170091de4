"""What code may import, and where it lies: layers, the tower of models, no circles, small rooms, mirrored tests."""

import ast
import importlib.util
import re
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType

from import_graph import BASE, ROOT, circles, imported_by, imports, modules, packages, room_of, rooms

LAYERS = ("models", "storage", "tasks", "flows")
"""Each imports only itself and those before it. The API and the command line (`src/humanmm`) may import all."""

TOWER = (
    "records",
    "geometry",
    "video",
    "weights",
    "body",
    "perception.runtime",
    "perception",
    "perception.keypoints",
    "perception.hands",
    "perception.lifting",
    "perception.tracking",
    "cuts",
    "shot_detection",
    "shots",
    "camera.odometry",
    "camera.background",
    "shadows",
    "camera",
    "camera.focal_length",
    "motion.fit",
    "motion.networks",
    "motion.rotations",
    "motion.world",
    "motion.refine",
    "motion.hands",
    "motion",
    "evaluation",
    "drawing",
    "synthetic",
    "rendering",
    "rendering.places",
    "learning",
    "learning.training",
    "benchmark",
    "benchmark.tables",
)
"""The rooms of models: each imports only rooms before it."""

SIZES = {
    "models.evaluation": "one file for each kind of metric",
    "models.benchmark.tables": "one file for each kind of table, and what they share",
    "models.shadows": "two steps of one estimate: the floor around a person, and the light on it",
    "cli": "one file for each subject of verbs, and what they share",
    "models.weights": "holds the files of weights; one module reads them",
    "tasks": "one file for each of the 12 stages, and what they share",
}
"""Rooms with fewer than 3 or more than 12 modules, and why."""

CROSS_CUTTING = {
    "flows/bench/test_bench_real.py": "two benchmarks on the real clip",
    "flows/bench/test_bench_render.py": "one benchmark from nothing to its table",
    "flows/server/test_retention.py": "settings of the server that Prefect applies",
    "flows/service/test_chaos.py": "all of it under random faults",
    "flows/service/test_schedule.py": "schedules through server and worker",
    "flows/service/test_watching.py": "what of batches needs no server: watched folders, the clock of a schedule",
    "flows/service/test_team_server.py": "the services of deploy/compose.yaml",
    "flows/test_brought_along.py": "the whole flow with results of other programs, on a real clip",
    "flows/test_corrections.py": "the whole flow with corrections, on a real clip",
    "flows/test_end_to_end.py": "the whole flow on the real clip",
    "flows/test_faults.py": "killed processes, whatever they ran",
    "models/benchmark/test_variable_rate.py": "a benchmark whose truth has a variable frame rate",
    "models/camera/test_rendered.py": "the whole camera room on rendered clips",
    "flows/test_variable_rate.py": "the whole flow on a variable frame rate",
    "flows/test_square_pixels.py": "the whole flow on pixels that are not square",
    "models/motion/fit/test_fit.py": "equations, terms and solver of the fit together",
    "models/motion/world/test_world_assembly.py": "the whole room on shots with known cameras",
    "models/evaluation/test_golden.py": "parity with the functions that WHAM and GVHMR publish",
    "models/perception/test_pose_networks.py": "every detector and pose network that is shipped",
    "models/perception/test_variable_rate.py": "the whole perception room on a variable frame rate",
    "storage/run_folder/exporters/test_blender.py": "files of five exporters, opened in Blender",
    "models/video/test_bad_input.py": "the whole video room on files that are no video",
    "models/video/test_real.py": "the whole video room on real clips",
}
"""Tests of a room without a module of their name, and what they test."""

UNTESTED = {
    "flows.bench.page": "the page of a report: test_bench_render opens it with its overlays",
    "flows.bench.shots": "one table: tests/cli/test_bench.py makes it from videos",
    "cli.maintain": "tests/cli/test_inspect.py and test_bucket_store.py type its verbs",
    "tasks.engine.runners.dask_runner": "test_runner has it where Dask is installed",
    "tasks.engine.runners.ray_runner": "test_runner has it where Ray is installed",
}
"""Modules that no test imports or is named after, and which test has what they do."""

KNOWN: Mapping[str, frozenset[str]] = {
    "layers": frozenset(),
    "tower": frozenset(),
    "file circles": frozenset(),
    "room circles": frozenset(),
    "docstrings": frozenset(),
    "sizes": frozenset(),
    "tests": frozenset(),
}
"""Violations that exist today, by rule. The list only shrinks: a violation that is gone leaves it."""


def _layer_of(module: str) -> int:
    """0 for the base, then `LAYERS`, then the API and the command line."""
    root = module.split(".")[0]
    if root in LAYERS:
        return 1 + LAYERS.index(root)
    return 0 if module in BASE else 1 + len(LAYERS)


def _floor_of(module: str) -> int:
    """The place of a module of models in the tower; -1 outside."""
    room = room_of(module).removeprefix("models").removeprefix(".")
    return TOWER.index(room) if room in TOWER else -1


def _arrow(module: str, imported: str) -> str:
    return f"{module} -> {imported}"


def _expect(rule: str, found: set[str]) -> None:
    new, gone = found - KNOWN[rule], KNOWN[rule] - found
    assert not new, f"new violations of {rule!r}: {sorted(new)}"
    assert not gone, f"these are no violations of {rule!r} any more, take them out of KNOWN: {sorted(gone)}"


def test_a_layer_imports_only_itself_and_the_layers_below() -> None:
    arrows = ((module, other) for module, others in imports().items() for other in others)
    _expect("layers", {_arrow(a, b) for a, b in arrows if _layer_of(a) < _layer_of(b)})


def test_the_rooms_of_models_are_those_of_the_tower() -> None:
    found = {room.removeprefix("models.") for room in rooms() if room.startswith("models.")}
    assert found == set(TOWER)


def test_a_room_of_models_imports_only_rooms_before_it() -> None:
    arrows = ((module, other) for module, others in imports().items() for other in others)
    _expect("tower", {_arrow(a, b) for a, b in arrows if -1 < _floor_of(a) < _floor_of(b)})


def test_no_circle_of_imports_between_files() -> None:
    _expect("file circles", {", ".join(sorted(circle)) for circle in circles(imports())})


def test_no_circle_of_imports_between_rooms() -> None:
    _expect("room circles", {", ".join(sorted(circle)) for circle in circles(rooms())})


def test_every_room_says_what_it_holds_in_one_or_two_sentences() -> None:
    wrong = set()
    for room in packages():
        text = ast.get_docstring(ast.parse(modules()[room].read_bytes())) or ""
        if not 1 <= len(re.findall(r"[.!?](?:\s|$)", text)) <= 2:
            wrong.add(room)
    _expect("docstrings", wrong)


def test_a_room_holds_3_to_12_modules_or_only_rooms() -> None:
    counts = dict.fromkeys(packages(), 0)
    for module in modules():
        if room_of(module) != module:
            counts[room_of(module)] += 1
    wrong = {room for room, count in counts.items() if count and not 3 <= count <= 12}
    assert not set(SIZES) - wrong, "these rooms have 3 to 12 modules now, take them out of SIZES"
    _expect("sizes", wrong - set(SIZES))


def test_every_test_of_a_room_is_named_after_a_module_of_it() -> None:
    tests = [path.relative_to(ROOT / "tests") for path in (ROOT / "tests").rglob("test_*.py")]
    of_rooms = [path for path in tests if len(path.parts) > 1 and ".".join(path.parent.parts) in modules()]
    strays = {str(path) for path in of_rooms if _tested_by(path) not in modules()}
    assert not set(CROSS_CUTTING) - strays, "these have a module of their name now, take them out of CROSS_CUTTING"
    _expect("tests", strays - set(CROSS_CUTTING))


def test_every_module_that_does_something_is_imported_by_a_test_or_has_one_of_its_name() -> None:
    trees = {path: ast.parse(path.read_bytes()) for path in (ROOT / "tests").rglob("*.py")}
    named = {_tested_by(path.relative_to(ROOT / "tests")) for path in trees if path.stem.startswith("test_")}
    imported = {name for tree in trees.values() for node in ast.walk(tree) for name in imported_by(node)}
    untested = {
        module
        for module, path in modules().items()
        if module not in named | imported and re.search(r"^(async def|def|class) ", path.read_text(), re.M)
    }
    assert not set(UNTESTED) - untested, "these have a test now, take them out of UNTESTED"
    assert untested == set(UNTESTED), f"no test imports {sorted(untested - set(UNTESTED))}"


def test_every_folder_of_tests_is_a_room() -> None:
    folders = {".".join(path.relative_to(ROOT / "tests").parent.parts) for path in (ROOT / "tests").rglob("test_*.py")}
    assert folders - modules().keys() <= {"deploy"}, "deploy/ holds what runs around the package"


def _tested_by(path: Path) -> str:
    return ".".join((*path.parent.parts, path.stem.removeprefix("test_")))


def test_scripts_import_what_is_there() -> None:
    """Most scripts are run by hand, months apart."""
    missing = []
    for path in sorted((ROOT / "scripts").iterdir()):
        if not path.is_file() or not path.read_text().startswith("#!/usr/bin/env python"):
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("humanmm"):
                module = importlib.import_module(str(node.module))
                absent = [one.name for one in node.names if not _has(module, one.name)]
                missing += [f"{path.name}: {node.module}.{name}" for name in absent]
    assert not missing


def _has(module: ModuleType, name: str) -> bool:
    of_package = hasattr(module, "__path__") and importlib.util.find_spec(f"{module.__name__}.{name}") is not None
    return hasattr(module, name) or of_package
