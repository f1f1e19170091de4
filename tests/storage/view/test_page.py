"""The page: one file, without network, whatever names are in it; in a browser, the same numbers as the recording."""

import base64
import itertools
import json
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Browser, find_browser

from humanmm.models.geometry import projection
from humanmm.models.records.recording import Recording
from humanmm.storage.view.embedded_video import write_embedded
from humanmm.storage.view.page import SCRIPTS, write_page
from humanmm.storage.view.scene import scene_tree

from .conftest import BITS, HOSTILE


@pytest.fixture(scope="module")
def page(
    recording: Recording, record: dict[str, Any], numbered_video: Path, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    folder = tmp_path_factory.mktemp("page")
    write_embedded(numbered_video, folder / "small.mp4")
    write_page(folder / "scene.html", recording, record, folder / "small.mp4")
    return folder / "scene.html"


class _Elements(HTMLParser):
    """Every element with its attributes and its text."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None], list[str]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs), []))

    def handle_data(self, data: str) -> None:
        if self.found:
            self.found[-1][2].append(data)


def _elements(page: Path) -> list[tuple[str, dict[str, str | None], list[str]]]:
    parser = _Elements()
    parser.feed(page.read_text(encoding="utf-8"))
    return parser.found


def test_the_page_refers_to_nothing_outside_itself(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert set(re.findall(r"\w{1,12}://[\w./-]+", text)) == {"http://www.w3.org/1999/xhtml"}, "a namespace of three.js"
    attributes = [name for _, found, _ in _elements(page) for name in found]
    assert not {"src", "href", "srcset", "action"} & set(attributes)
    assert "default-src 'none'" in text and "Permission is hereby granted, free of charge" in text
    assert page.stat().st_size < 3e6


def test_scripts_run_in_order_and_none_ends_early(page: Path) -> None:
    scripts = ["".join(text).strip() for tag, found, text in _elements(page) if tag == "script" and not found]
    folder = Path(write_page.__code__.co_filename).parent / "page"
    assert scripts == [(folder / name).read_text(encoding="utf-8").strip() for name in SCRIPTS]
    assert all("innerHTML" not in script and "document.write" not in script for script in scripts[1:])


def test_names_and_messages_stay_text(page: Path, recording: Recording, record: dict[str, Any]) -> None:
    (data,) = [text for tag, found, text in _elements(page) if found.get("id") == "recording"]
    assert "<" not in "".join(data)
    tree = json.loads("".join(data))
    assert tree["name"] == Path(HOSTILE).name and HOSTILE in tree["warnings"][0]["text"]
    assert tree == json.loads(json.dumps(scene_tree(recording, record)))


def test_the_video_is_inside(page: Path) -> None:
    (data,) = [text for tag, found, text in _elements(page) if found.get("id") == "video-data"]
    assert base64.b64decode("".join(data)) == page.with_name("small.mp4").read_bytes()


# ---- in a browser


@pytest.fixture
def browser(page: Path, tmp_path: Path) -> Iterator[Browser]:
    """A browser that shows the page."""
    if find_browser() is None:
        pytest.skip("no Chromium here")
    with Browser(tmp_path / "profile") as started:
        started.open(page)
        assert started.run("humanmm.ready") is True
        yield started
        assert started.run("humanmm.errors") == [] and started.console == []


NUMBER_IN_PICTURE = f"""(() => {{
  const video = document.getElementById("video"), canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [{16 * BITS}, 16];
  const context = canvas.getContext("2d");
  context.drawImage(video, 0, 0, {16 * BITS}, 16, 0, 0, {16 * BITS}, 16);
  const pixels = context.getImageData(0, 8, {16 * BITS}, 1).data;
  let number = 0;
  for (let bit = 0; bit < {BITS}; bit++) number |= (pixels[4 * (16 * bit + 8)] > 128) << bit;
  return number;
}})()"""


@pytest.mark.slow
def test_the_browser_shows_video_and_world_of_one_frame(browser: Browser, recording: Recording) -> None:
    assert browser.run("!!humanmm.viewer.clock.video"), "this browser plays H.264"
    for frame in (0, 7, 24, 25, 26, 39, 3):
        browser.run(f"humanmm.seek({frame})")
        assert browser.run("humanmm.frame()") == frame
        assert browser.run(NUMBER_IN_PICTURE) == frame
    assert "shot 0" in browser.run("document.getElementById('now').textContent")
    np.testing.assert_allclose(browser.run("humanmm.recording.time[30]"), recording.time_s[30] - recording.time_s[0])


@pytest.mark.slow
def test_while_it_plays_the_world_is_where_the_video_is(browser: Browser) -> None:
    pairs = browser.run(f"""new Promise((done) => {{
      const pairs = [], {{ clock, video }} = {{ clock: humanmm.viewer.clock, video: document.getElementById("video") }};
      const look = () => {{
        pairs.push([humanmm.frame(), {NUMBER_IN_PICTURE}]);
        if (video.ended || pairs.length > 300) done(pairs); else video.requestVideoFrameCallback(look);
      }};
      humanmm.seek(0).then(() => {{ video.requestVideoFrameCallback(look); clock.setSpeed(0.1); clock.play(); }});
      video.addEventListener("ended", () => done(pairs));
    }})""")
    assert len(pairs) >= 5 and pairs[-1][0] > 20, "software rendering leaves out frames"
    assert max(abs(world - shown) for world, shown in pairs) <= 1, "a picture may change while it is read"
    assert np.mean([world == shown for world, shown in pairs]) > 0.8


@pytest.mark.slow
def test_joints_are_those_of_the_recording_and_their_pixels_those_of_its_camera(
    browser: Browser, recording: Recording
) -> None:
    browser.run("humanmm.choose('shot')")
    for size, frame in itertools.product(((1280, 720), (900, 800)), (10, 24, 30)):
        browser.resize(*size)
        browser.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        browser.run(f"humanmm.seek({frame})")
        for index, person in enumerate(recording.people):
            joints = person.joints[frame - person.frame[0]]
            assert np.abs(np.array(browser.run(f"humanmm.joints({index})")) - joints).max() < 1e-3
            R, t = recording.R_world_cam[frame], recording.t_world_cam[frame]
            in_camera = projection.world_to_camera(joints.astype(np.float64), R, t)
            expected = projection.project(in_camera, recording.K[frame], near_m=0.05)
            assert np.abs(np.array(browser.run(f"humanmm.pixels({index})")) - expected).max() < 1.0


@pytest.mark.slow
def test_views_people_keys_and_hostile_names(browser: Browser, tmp_path: Path) -> None:
    assert browser.run("document.title").startswith(Path(HOSTILE).name[:5])
    assert browser.run("document.querySelectorAll('img').length") == 0
    for mode in ("free", "shot", "side", "other side", "top", "follow"):
        browser.run(f"humanmm.choose('{mode}')")
        browser.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        assert browser.run("document.querySelector('button.chosen').textContent") == mode
    press = "dispatchEvent(new KeyboardEvent('keydown', {{key: '{}'}}))"
    browser.run(press.format("ArrowDown"))
    browser.run("new Promise(done => setTimeout(done, 500))")
    assert browser.run("humanmm.frame()") == 25
    assert browser.run("humanmm.viewer.world.bodies[1].mesh.visible") is True
    browser.run("document.querySelectorAll('#people input')[1].click()")
    assert browser.run("humanmm.viewer.world.bodies[1].mesh.visible") is False
    browser.screenshot(tmp_path / "page.png")
    assert (tmp_path / "page.png").stat().st_size > 50_000
