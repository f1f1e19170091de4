"""The pages of docs: links lead somewhere, settings are those of the configuration, examples run, the site builds."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

from humanmm.cli import main
from humanmm.cli.verb import app
from humanmm.models.camera.shot_camera import estimate_camera
from humanmm.models.perception.picture import Picture
from humanmm.models.perception.regions import Region
from humanmm.models.records.camera import Intrinsics, PointTracks
from humanmm.models.records.shots import Shot
from humanmm.models.records.tracks import ScenePeople

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_and_pictures_of_a_page_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)#\s]+)", page.read_text())
    gone = [link for link in links if "://" not in link and not (page.parent / link).exists()]
    assert not gone


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_files_that_a_page_names_are_there(page: Path) -> None:
    named = re.findall(r"[ `]((?:deploy|examples|flows|models|src|storage|tasks|tests)/[\w./-]*\w)", page.read_text())
    files = {path for path in named if "/test_" not in path and "NAME" not in path}
    assert sorted(path for path in files if not list(ROOT.glob(f"{path}*"))) == []


def test_tests_that_the_docs_name_are_there() -> None:
    """As `test_name`, `room/test_file` or `room/test_file: test_name`."""
    folder, names = ROOT / "tests", r"def (test_\w+)"
    files = {
        str(path.relative_to(folder).with_suffix("")): set(re.findall(names, path.read_text()))
        for path in folder.rglob("test_*.py")
    }
    known = {name.rpartition("/")[2] for name in files}.union(*files.values())
    for page in PAGES:
        for file, name in re.findall(r"(?<![\w/])(?:tests/)?((?:\w+/)*test_\w+)(?:: (test_\w+))?", page.read_text()):
            assert file in (files if "/" in file else known), f"{page.name}: there is no {file}"
            assert not name or name in files.get(file, known), f"{page.name}: {file} has no {name}"


def _commands(page: Path) -> list[str]:
    """What a page has its reader type: lines of blocks, and what stands in backticks; of alternatives the first."""
    text = page.read_text()
    lines = re.findall(r"^ {4}(?:\$ |[^\s`|]*bin/)?(humanmm [a-z][^\n]*)", text, re.M)
    found = [line.partition(" #")[0] for line in lines] + re.findall(r"`(humanmm [a-z][^`\n]*)`", text)
    parts = [re.sub(r"(?:\\?\|[^\s|]+)+", "", part.strip()) for line in found for part in line.split(" && ")]
    return [re.sub(r"[\[\]]", "", part) for part in parts if "…" not in part.replace("FILE…", "FILE")]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_of_a_page_are_read_by_the_command_line(page: Path) -> None:
    main(["--version"])  # declares all verbs
    stands_for = {"N": "3", "LOW": "1", "HIGH": "2", "W": "64", "H": "64", "S": "1", "STAGE": "refine"}
    for line in _commands(page):
        words = [
            stands_for.get(word, word)
            for word in shlex.split(line.replace("format NAME", "format bvh").replace("build NAME", "build emdb"))[1:]
        ]
        found: Any = typer.main.get_command(app)
        name = "humanmm"
        while words and hasattr(found, "commands") and words[0] in found.commands:
            name = words.pop(0)
            found = found.commands[name]
        if not words or "--help" in words:
            continue  # it is only named
        try:
            found.make_context(name, words)
        except typer.TyperException as error:
            pytest.fail(f"{page.name}: `{line}`: {error.format_message()}")


def test_people_and_cameras_of_the_blender_recipe_have_one_frame_rate() -> None:
    exports = re.findall(r"^    humanmm export .*", (ROOT / "docs/blender.md").read_text(), re.MULTILINE)
    rates = [re.search(r"--fps (\S+)", line) for line in exports]
    assert len(exports) == 2 and len({rate[1] if rate else None for rate in rates}) == 1, exports


def test_every_page_is_in_the_sites_contents() -> None:
    contents = (ROOT / "mkdocs.yml").read_text()
    pages = [page.relative_to(ROOT / "docs").as_posix() for page in (ROOT / "docs").rglob("*.md")]
    assert [page for page in pages if f": {page}\n" not in contents] == []


def test_the_page_of_settings_is_that_of_the_configuration(tmp_path: Path) -> None:
    for part in ("scripts/write_settings_page", "docs"):
        (tmp_path / part).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / "docs").mkdir()
    shutil.copy2(ROOT / "scripts/write_settings_page", tmp_path / "scripts")
    subprocess.run([sys.executable, tmp_path / "scripts/write_settings_page"], check=True)
    assert (tmp_path / "docs/settings.md").read_text() == (ROOT / "docs/settings.md").read_text(), (
        "run scripts/write_settings_page"
    )


@pytest.fixture(scope="module")
def examples() -> dict[str, Any]:
    """What docs/extend.md defines."""
    names: dict[str, Any] = {}
    for block in re.findall(r"```python\n(.*?)```", (ROOT / "docs/extend.md").read_text(), re.S):
        exec(compile(block, "docs/extend.md", "exec"), names)
    return names


def test_the_detector_of_the_docs_finds_boxes_in_source_pixels(examples: dict[str, Any]) -> None:
    light = np.full((480, 640), 128, np.uint8)
    light[100:400, 300:360] = 20
    image = Picture((light, np.full((240, 320), 128, np.uint8), np.full((240, 320), 128, np.uint8)))
    found = examples["upright"](image, Region(320, 240, 640))
    assert all(0 <= one.score <= 1 and one.box.shape == (4,) for one in found)
    assert [one.score for one in found] == sorted((one.score for one in found), reverse=True)


def test_the_camera_estimator_of_the_docs_stands_still(examples: dict[str, Any]) -> None:
    nothing = np.zeros(0)
    points = PointTracks(0, 20, nothing.astype(np.int32), nothing.astype(np.int32), np.zeros((0, 2)), nothing, 21.0)
    intrinsics = Intrinsics(900.0, 1280, 720, "given", 0.0)
    shot = Shot(0, 5, 15, 0, None, ())
    camera = estimate_camera(shot, points, ScenePeople(0, 20, ()), intrinsics, estimator=examples["standing"])
    assert (camera.start, camera.end, camera.source) == (5, 15, "static")
    assert camera.K.shape == (10, 3, 3) and (camera.K[:, 0, 0] == 900).all()


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    mkdocs = shutil.which("mkdocs")
    if mkdocs is None:
        pytest.skip("needs mkdocs: pip install -e '.[docs]'")
    command = [mkdocs, "build", "--strict", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "site/blender/index.html").is_file()
