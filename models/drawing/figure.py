"""matplotlib's object interface without its global state, so that threads do not meet."""

import numpy as np
from jaxtyping import UInt8
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from humanmm.models.drawing import palette

DPI, CSS_DPI = 110, 96
"""Of pictures, and of figures in HTML: a CSS pixel is 1/96 inch."""
TOOLTIP = "tooltip: "
"""An artist whose gid begins so has the rest of it as a tooltip in HTML."""
TEXT = "#23262b"
SOFT = "#8a9099"
GRID = "#e6e8eb"


def new_figure(width_px: float, height_px: float, *, dpi: int = DPI) -> Figure:
    """An empty white figure of this size."""
    return Figure(figsize=(width_px / dpi, height_px / dpi), dpi=dpi, facecolor="white")


def axes_at(figure: Figure, left_px: float, top_px: float, right_px: float, height_px: float) -> Axes:
    """Axes at distances from the figure's left, upper and right edges; labels stand outside of them.

    matplotlib's automatic layouts draw everything twice to find this out.
    """
    width, height = figure.get_size_inches() * figure.dpi
    box = (left_px / width, 1 - (top_px + height_px) / height, 1 - (left_px + right_px) / width, height_px / height)
    return figure.add_axes(box)


def quiet_axes(axes: Axes) -> None:
    """Thin grey ticks, no upper and right border."""
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(SOFT)
    axes.tick_params(colors=TEXT, labelsize=8, length=3, color=SOFT)
    axes.set_axisbelow(True)


def picture(figure: Figure) -> UInt8[np.ndarray, "H W 3"]:
    """The figure's pixels, RGB."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()  # type: ignore[no-untyped-call]


def hex_color(color: palette.RGB) -> str:
    """#rrggbb."""
    return "#{:02x}{:02x}{:02x}".format(*color)
