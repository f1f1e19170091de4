"""What is kept about sources never answers for another source."""

import ast
import json
from pathlib import Path

import pytest

from humanmm.tasks.units import module_facts
from humanmm.tasks.units.module_facts import KnownModules, read_module

SOURCE = b"import numpy\nfrom .deep import K\n\n\ndef f():\n    return open('net.tflite'), K\n"


def test_kept_facts_are_those_of_the_source_without_parsing_it_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = KnownModules(tmp_path / "modules.json")
    facts = first.facts(SOURCE, "package")
    assert facts == read_module(SOURCE, "package")
    assert facts.imports == ("numpy", "package.deep", "package.deep.K")
    assert facts.strings == ("net.tflite",)
    first.save()

    def fail(source: bytes, package: str) -> None:
        raise AssertionError("parsed again")

    monkeypatch.setattr(module_facts, "read_module", fail)
    assert KnownModules(tmp_path / "modules.json").facts(SOURCE, "package") == facts


def test_a_changed_source_or_package_is_read_anew(tmp_path: Path) -> None:
    known = KnownModules(tmp_path / "modules.json")
    facts = known.facts(SOURCE, "package")
    assert known.facts(SOURCE + b"x = 1\n", "package").digest != facts.digest
    assert known.facts(SOURCE, "other").imports == ("numpy", "other.deep", "other.deep.K")


@pytest.mark.parametrize(
    "change", ["", "{", '{"modules": 3}', '{"made_by": "somebody else", "modules": {"a": ["b", [], []]}}']
)
def test_a_damaged_or_foreign_file_is_left_out_of_account(change: str, tmp_path: Path) -> None:
    path = tmp_path / "modules.json"
    path.write_text(change)
    known = KnownModules(path)
    assert known.facts(SOURCE, "package") == read_module(SOURCE, "package")
    known.save()
    assert len(json.loads(path.read_text())["modules"]) == 1


def test_without_a_folder_that_can_be_written_sources_are_parsed_each_time(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    path = tmp_path / "file" / "modules.json"
    known = KnownModules(path)
    assert known.facts(SOURCE, "package") == read_module(SOURCE, "package")
    known.save()
    assert not path.exists() and (tmp_path / "file").read_text() == ""
    assert KnownModules(path).facts(SOURCE, "package") == known.facts(SOURCE, "package")


def test_parsing_is_tried_again_when_python_itself_trips_over_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    source, parse, calls = b"import numpy\n", ast.parse, []
    whole = read_module(source, "humanmm")

    def trips_once(text: bytes) -> ast.Module:
        calls.append(text)
        if len(calls) == 1:
            raise SystemError("AST constructor recursion depth mismatch (before=51, after=355)")
        return parse(text)

    with monkeypatch.context() as patched:
        patched.setattr(ast, "parse", trips_once)
        again = read_module(source, "humanmm")
    assert again == whole and len(calls) == 2
