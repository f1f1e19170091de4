"""Smooth small text on pictures: DejaVu Sans from matplotlib, drawn by its own FreeType into a mask."""

from functools import lru_cache
from pathlib import Path

import matplotlib
import numpy as np
from jaxtyping import UInt8
from matplotlib.ft2font import FT2Font


class Lettering:
    """Text of one size. Not shared between threads."""

    def __init__(self, size_px: int, *, bold: bool = False) -> None:
        name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
        self._font = FT2Font(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name))
        self._font.set_size(size_px, 72)
        self.height = round(size_px * 1.3)
        self._baseline = round(size_px * 1.02)
        self._glyph = lru_cache(maxsize=256)(self._draw_glyph)

    def width(self, text: str) -> int:
        """Width of the text in pixels."""
        return sum(self._glyph(letter)[1] for letter in text)

    def mask(self, text: str) -> UInt8[np.ndarray, "h w"]:
        """Coverage of the text's pixels, 0..255."""
        if not text:
            return np.zeros((self.height, 0), np.uint8)
        return np.concatenate([self._glyph(letter)[0] for letter in text], axis=1)

    def _draw_glyph(self, letter: str) -> tuple[np.ndarray, int]:
        self._font.set_text(letter, 0.0)
        self._font.draw_glyphs_to_bitmap(antialiased=True)
        glyph = np.asarray(self._font.get_image())
        info = self._font.load_char(ord(letter))
        advance = round(info.linearHoriAdvance / 65536)
        cell = np.zeros((self.height, advance), np.uint8)
        left, top = info.bbox[0] // 64, self._baseline - -(-info.bbox[3] // 64)
        for row in range(glyph.shape[0]):
            y = top + row
            if 0 <= y < self.height:
                x0 = max(left, 0)
                piece = glyph[row, x0 - left : x0 - left + advance - x0]
                cell[y, x0 : x0 + len(piece)] = piece
        return cell, advance
