"""HTML from the templates of this folder, and matplotlib's figures as SVG inside it; equal input gives equal bytes."""

import io
import re
from typing import Any

import matplotlib
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from humanmm.models.drawing.figure import TOOLTIP

_TEMPLATES = Environment(
    loader=PackageLoader("humanmm.storage.pages"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)


def fill(template: str, **values: Any) -> str:
    """The text of a template with these values, every one of them escaped."""
    return _TEMPLATES.get_template(template).render(values)


def svg_of(figure: Figure) -> Markup:
    """The figure as an <svg> element for an HTML page: text stays text, TOOLTIP gids become tooltips."""
    stream = io.StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "humanmm", "svg.fonttype": "none"}):
        figure.savefig(stream, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    text = stream.getvalue()
    text = re.sub(r' xmlns(:\w+)?="[^"]*"', "", text[text.index("<svg") :])  # HTML knows these namespaces
    text = re.sub(f'<g id="{TOOLTIP}([^"]*)">', r"<g><title>\1</title>", text)
    return Markup(re.sub(r'<g id="[^"]*"', "<g", text))  # the same in every figure, and nothing refers to them
