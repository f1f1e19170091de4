"""The page scene.html: one file with everything in it, for a browser without server and network.

The scripts in `page/` are read as they are; three.min.js is three.js (scripts/build_three makes it). Names and messages
of users are JSON inside a script element, in which `<`, `>` and `&` are escaped; the scripts show them as text alone.
"""

import base64
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from markupsafe import Markup

from humanmm.models.records.recording import Recording
from humanmm.storage.pages.html import fill
from humanmm.storage.store.files import replace_text
from humanmm.storage.view.scene import scene_tree

SCRIPTS = ("three.min.js", "recording.js", "clock.js", "world.js", "views.js", "timeline.js", "viewer.js")
"""In the order in which the browser runs them."""
_ESCAPED = {ord(one): f"\\u{ord(one):04x}" for one in "<>&"}


def write_page(path: Path, recording: Recording, record: Mapping[str, Any], video: Path | None) -> None:
    """Write the page of one run; `record` is the tree of run.json, `video` an mp4 with the frames of the recording."""
    folder = Path(__file__).parent / "page"
    text = fill(
        "viewer.html",
        recording=Markup(json_in_html(scene_tree(recording, record))),
        video=Markup("" if video is None else base64.b64encode(video.read_bytes()).decode()),
        scripts=[Markup((folder / name).read_text(encoding="utf-8")) for name in SCRIPTS],
    )
    replace_text(path, text)


def json_in_html(tree: Any) -> str:
    """JSON that no HTML parser takes for the end of its script element, or for a comment."""
    return json.dumps(tree, separators=(",", ":")).translate(_ESCAPED)
