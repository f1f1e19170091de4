"""docs/architecture.md and its picture say what the code is."""

import html
import re
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from types import ModuleType

from import_graph import ROOT

PAGE = ROOT / "docs" / "architecture.md"


def _script() -> ModuleType:
    loader = SourceFileLoader("draw_architecture", str(ROOT / "scripts" / "draw_architecture"))
    spec = spec_from_loader(loader.name, loader)
    assert spec is not None
    module = module_from_spec(spec)
    loader.exec_module(module)
    return module


def test_the_picture_shows_the_rooms_and_arrows_of_today() -> None:
    script = _script()
    found = re.search(r"<dc:description>(.*?)</dc:description>", script.PICTURE.read_text(), re.DOTALL)
    assert found is not None
    assert html.unescape(found[1]) == script.arrows_text(script.drawn_rooms()), "run scripts/draw_architecture"


def test_every_file_that_the_page_names_exists() -> None:
    named = set(re.findall(r"`((?:models|storage|tasks|flows|src|scripts|tests)/[\w/.]*)`", PAGE.read_text()))
    assert len(named) > 30
    assert {name for name in named if not (ROOT / name).exists()} == set()
