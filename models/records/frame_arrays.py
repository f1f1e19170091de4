"""What records of a track have in common: arrays with a row for each of its frames."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np


@dataclass(frozen=True)
class FrameArrays:
    """Fields that are all arrays over the N frames of a track."""

    def chosen(self, rows: slice | np.ndarray) -> Self:
        """Those of some rows."""
        return replace(self, **{name: values[rows] for name, values in vars(self).items()})

    def then(self, other: Self) -> Self:
        """These, and others after them."""
        pairs = zip(vars(self).items(), vars(other).values(), strict=True)
        return replace(self, **{name: np.concatenate([own, after]) for (name, own), after in pairs})
