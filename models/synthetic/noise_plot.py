"""The fit of ms-Mocap's noise as a figure: what was measured on rendered clips beside what the model makes of them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from humanmm.models.synthetic.noise_fit import NoiseFit, rates_of_change
from humanmm.models.synthetic.noise_series import Series, simulate

_JOINTS = {
    "shoulders": (11, 12),
    "elbows": (13, 14),
    "wrists": (15, 16),
    "hips": (23, 24),
    "knees": (25, 26),
    "ankles": (27, 28),
}
_FAR = (10_000, 10_000)
"""The picture's edge plays no part in the comparison."""


def plot_fit(fit: NoiseFit) -> Figure:
    """Twelve axes: distributions of errors, tilt and lean, hidden and lost limbs, changes with speed."""
    rng = np.random.default_rng(0)
    modelled = [simulate(_inside(one), fit.noise, rng, _FAR) for one in fit.series]
    figure = Figure(figsize=(13, 10), layout="constrained")
    axes = figure.subplots(3, 4).ravel()
    for axis, (name, joints) in zip(axes[:6], _JOINTS.items(), strict=True):
        _distribution(axis, name, fit.series, modelled, joints)
    _line(axes[6], fit.series, 0, "pitch", fit.noise.tilt_deg, fit.noise.tilt_per_pitch, "tilt about x, °")
    _line(axes[7], fit.series, 2, "roll", 0.0, fit.noise.lean_per_roll, "lean about z, °")
    _rotations(axes[8], fit.series, modelled)
    _solid(axes[9], fit.series, modelled)
    _rates(axes[10], fit.series, modelled)
    _changes(axes[11], fit.series, modelled)
    return figure


def _inside(one: Series) -> Series:
    """The same with the points moved far from every edge, so that the model finds everybody."""
    K = one.K.copy()
    K[:, :2, 2] += 4000
    return replace(one, K=K)


def _distribution(
    axis: Axes, name: str, measured: Sequence[Series], modelled: Sequence[Series], joints: tuple[int, int]
) -> None:
    for label, series in (("measured", measured), ("modelled", modelled)):
        values = np.concatenate(
            [np.linalg.norm(one.picture[one.found][:, list(joints)], axis=-1).ravel() for one in series]
        )
        axis.plot(100 * np.sort(values), np.linspace(0, 1, len(values)), label=label)
    axis.set(title=f"{name}: 2D error, % of height", xlim=(0, 12), ylim=(0, 1))
    axis.legend(loc="lower right")


def _line(
    axis: Axes, series: Sequence[Series], about: int, against: str, offset_deg: float, slope: float, title: str
) -> None:
    x = np.degrees([getattr(one.errors, against).mean() for one in series])
    y = np.degrees([np.median(one.rotation[one.found, about]) for one in series])
    ends = np.array([x.min(), x.max()])
    axis.plot(x, y, ".", label="a person in a shot")
    axis.plot(ends, offset_deg + slope * ends, label=f"{offset_deg:.1f} + {slope:.2f} · {against}")
    axis.set(title=title, xlabel=f"{against}, °")
    axis.legend()


def _rotations(axis: Axes, measured: Sequence[Series], modelled: Sequence[Series]) -> None:
    for label, series, style in (("measured", measured, "-"), ("modelled", modelled, "--")):
        rotation = np.degrees(np.concatenate([one.rotation[one.found] for one in series]))
        for k, name in enumerate("xyz"):
            values = np.sort(rotation[:, k])
            axis.plot(values, np.linspace(0, 1, len(values)), style, color=f"C{k}", label=f"{label} {name}")
    axis.set(title="rotation of the 3D landmarks, °", xlim=(-30, 30))
    axis.legend(fontsize="small")


def _solid(axis: Axes, measured: Sequence[Series], modelled: Sequence[Series]) -> None:
    for label, series in (("measured", measured), ("modelled", modelled)):
        left = np.concatenate([np.linalg.norm(one.solid[one.found][:, 11:], axis=-1).ravel() for one in series])
        axis.plot(1000 * np.sort(left), np.linspace(0, 1, len(left)), label=label)
    axis.set(title="3D error after rotation and scale, mm", xlim=(0, 250), ylim=(0, 1))
    axis.legend(loc="lower right")


def _changes(axis: Axes, measured: Sequence[Series], modelled: Sequence[Series]) -> None:
    for label, series, style in (("measured", measured, "o-"), ("modelled", modelled, "s--")):
        speed, change = rates_of_change(series)
        axis.plot(speed, 100 * change, style, label=label)
    axis.set(title="change of the error in a frame, %", xlabel="speed, heights a second")
    axis.legend()


def _rates(axis: Axes, measured: Sequence[Series], modelled: Sequence[Series]) -> None:
    limbs = ("left arm", "right arm", "left leg", "right leg")
    names = [f"{limb} {event}" for event in ("hidden", "lost") for limb in limbs]
    for offset, (label, series) in enumerate((("measured", measured), ("modelled", modelled))):
        fractions = [
            np.concatenate([getattr(one, event)[:, one.found] for one in series], axis=1).mean(axis=1)
            for event in ("hidden", "lost")
        ]
        axis.barh(np.arange(len(names)) + 0.4 * offset, 100 * np.concatenate(fractions), 0.4, label=label)
    axis.set(title="fraction of the frames, %", yticks=np.arange(len(names)) + 0.2, yticklabels=names)
    axis.legend()
