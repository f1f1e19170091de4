"""Motion that nobody performed: kicks, spins, jumps, floor work, dances and acrobatics from key postures.

Packs of motion capture hold few of these from people whom no shipped network was trained on. A routine is a random
list of postures (joint angles in degrees) with durations; joints move between them with minimum jerk (Flash and Hogan
1985), the lowest parts of the body rest on the floor and do not slip, and flights follow gravity.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from humanmm.models.body.body24 import NUM_JOINTS, load_body
from humanmm.models.body.kinematics import forward_kinematics
from humanmm.models.geometry.axes import R_ZUP_YUP
from humanmm.models.records.recording import CONTACT_JOINTS
from humanmm.models.synthetic.mocap import MocapSequence, leg_length

Array = np.ndarray

RATE_HZ = 60.0
GRAVITY_MS2 = 9.81
FASTEST_MS = 2.5
"""Of the pelvis along the floor."""
_SMOOTH_S = 0.03
_TREMOR_DEG = 1.5
_CONTACT_M = 0.02
"""Parts so far above the lowest one carry the body too (1/e)."""
_RADIUS_M = np.array([
    0.12, 0.10, 0.10, 0.11, 0.06, 0.06, 0.11, 0.08, 0.08, 0.12, 0.025, 0.025, 0.06, 0.07, 0.07, 0.13, 0.07, 0.07,
    0.05, 0.05, 0.03, 0.03, 0.025, 0.025,
])  # fmt: skip
"""From each joint to the skin below it."""

Side = tuple[float, float, float]


@dataclass(frozen=True)
class Posture:
    """Angles in degrees; (left, right) where there are two."""

    legs: tuple[Side, Side] = ((4, 4, 6), (4, 4, 6))
    """Hip flexion, hip abduction, knee flexion."""
    arms: tuple[Side, Side] = ((10, 20, 15), (10, 20, 15))
    """Elevation from hanging, in a plane from the side (0) to the front (90), elbow flexion."""
    spine: Side = (0, 0, 0)
    """Bend forward, twist, lean to the right."""
    head: float = 0
    """Nod."""
    root: tuple[float, float, float, float] = (0, 0, 0, 0)
    """Heading, pitch forward, roll to the right, turn about the body's own long axis: they add up over a routine."""
    ankles: float | None = None
    """Both ankles' extension; None keeps the soles level."""


@dataclass(frozen=True)
class Step:
    """Move to a posture in some seconds, in flight or not."""

    posture: Posture
    seconds: float
    in_flight: bool = False


def _both(*angles: float) -> tuple[Side, Side]:
    side = (angles[0], angles[1], angles[2])
    return side, side


STAND = Posture()
GUARD = Posture(((25, 8, 35), (-5, 10, 25)), _both(40, 70, 125), (8, 15, 0))
CROUCH = Posture(_both(75, 8, 105), _both(35, 80, 40), (25, 0, 0))
SQUAT = Posture(_both(115, 14, 140), _both(80, 90, 20), (25, 0, 0))
LUNGE = Posture(((70, 2, 75), (-25, 4, 25)), _both(30, 60, 90), (10, 0, 0))
STAR = Posture(_both(5, 38, 5), _both(140, 10, 5), ankles=30)
TUCK = Posture(_both(110, 8, 120), _both(60, 90, 60), (25, 0, 0), ankles=25)
REACH = Posture(((0, 2, 5), (15, 3, 20)), _both(170, 30, 10), (-10, 0, 0), ankles=35)
CHAMBER = Posture(((8, 4, 15), (100, 5, 115)), _both(45, 60, 110), (5, 0, 0))
FRONT_KICK = Posture(((0, 4, 12), (100, 5, 8)), ((30, 20, 60), (30, 20, 60)), (-8, 0, 0))
ROUND_KICK = Posture(((0, 6, 12), (65, 65, 10)), ((70, 40, 70), (40, 0, 40)), (0, 10, -25))
SIDE_KICK = Posture(((5, 8, 14), (40, 85, 5)), _both(40, 40, 100), (0, 0, -30))
SPINNER = Posture(((2, 3, 4), (35, 20, 90)), _both(75, 75, 80), (-3, 0, 0))
OPEN_SPIN = Posture(((2, 3, 6), (10, 15, 15)), _both(95, 10, 10))
ALL_FOURS = Posture(_both(90, 5, 90), _both(88, 90, 5), (5, 0, 0), -25, (0, 90, 0, 0), 40)
CRAWL = Posture(((115, 5, 95), (70, 5, 90)), ((70, 90, 5), (112, 90, 5)), (5, 0, 0), -25, (0, 90, 0, 0), 40)
PLANK = Posture(_both(2, 4, 3), _both(78, 90, 4), (3, 0, 0), -15, (0, 74, 0, 0), -10)
PRESS = Posture(_both(0, 4, 3), _both(65, 25, 105), (0, 0, 0), -20, (0, 86, 0, 0), -10)
PRONE = Posture(_both(0, 8, 5), ((150, 30, 30), (150, 30, 30)), (-8, 0, 0), -20, (0, 90, 0, 0), 50)
SUPINE = Posture(_both(10, 8, 15), _both(25, 10, 10), (5, 0, 0), 10, (0, -88, 0, 0), 30)
SIT = Posture(((85, 12, 15), (85, 12, 40)), _both(35, -50, 10), (10, 0, 0), 0, (0, -12, 0, 0), 20)
SIT_UP = Posture(_both(95, 8, 85), _both(60, 80, 120), (35, 0, 0), 10, (0, -25, 0, 0), 0)
HANDSTAND = Posture(_both(0, 6, 5), _both(172, 80, 3), (-5, 0, 0), -15, (0, 180, 0, 0), 40)
WHEEL = Posture(_both(5, 45, 3), _both(165, 5, 3), (0, 0, 0), 0, (0, 0, 0, 0), 30)

KINDS = ("kick", "spin", "jump", "floor", "dance", "acrobatics")


def choreography(kind: str, name: str, seconds: float, rng: np.random.Generator) -> MocapSequence:
    """A routine of one kind, at least so many seconds long, on body24's mean shape."""
    steps = [Step(replace(STAND, arms=_both(15, 20, 20)), 0.0)]
    heading = 0.0
    while sum(step.seconds for step in steps) < seconds + 0.5:
        added = _ROUTINES[kind](rng)
        if rng.random() < 0.5:
            added = [replace(step, posture=mirrored(step.posture)) for step in added]
        base = np.array(steps[-1].posture.root)
        ended = [heading, *(360 * np.rint(base[1:] / 360))]
        steps += [replace(s, posture=replace(s.posture, root=tuple(ended + np.array(s.posture.root)))) for s in added]
        heading = steps[-1].posture.root[0]
    return performed(steps, name, rng)


def mirrored(posture: Posture) -> Posture:
    """Left and right exchanged."""
    heading, pitch, roll, turn = posture.root
    bend, twist, lean = posture.spine
    return replace(
        posture, legs=posture.legs[::-1], arms=posture.arms[::-1], spine=(bend, -twist, -lean),
        root=(-heading, pitch, -roll, -turn),
    )  # fmt: skip


def performed(steps: Sequence[Step], name: str, rng: np.random.Generator) -> MocapSequence:
    """The steps as motion: joint angles, then the pelvis that keeps the body on the floor."""
    ends = np.cumsum([step.seconds for step in steps])
    time = np.arange(int(ends[-1] * RATE_HZ)) / RATE_HZ
    after = np.clip(np.searchsorted(ends, time, side="right"), 1, len(steps) - 1)
    s = np.clip((time - ends[after - 1]) / np.maximum([steps[k].seconds for k in after], 1e-6), 0, 1)
    eased = s**3 * (10 - 15 * s + 6 * s**2)
    sigma = _SMOOTH_S * RATE_HZ

    def between(keys: Array) -> Array:
        values = keys[after - 1] + eased.reshape(-1, *(1,) * (keys.ndim - 1)) * (keys[after] - keys[after - 1])
        return np.asarray(gaussian_filter1d(values, sigma, axis=0, mode="nearest"))

    pose = between(np.stack([_joint_vectors(step.posture) for step in steps]))
    tremor = gaussian_filter1d(rng.normal(size=pose.shape), 0.15 * RATE_HZ, axis=0)
    pose = pose + np.deg2rad(_TREMOR_DEG) * tremor / tremor.std()
    heading, pitch, roll, turn = between(np.array([step.posture.root for step in steps], float)).T
    upright = Rotation.from_euler("YXZ", np.stack([heading, pitch, roll], axis=1), degrees=True)
    R = (upright * Rotation.from_euler("Y", turn[:, None], degrees=True)).as_matrix()
    body = load_body()
    rest = body.rest_joints(np.zeros(body.num_betas))
    joints, _ = forward_kinematics(rest, R, pose, np.zeros((len(time), 3)))
    flies = np.array([step.in_flight for step in steps])[after]
    pelvis = _on_the_floor(joints, flies, sigma)
    for first, last in _runs(flies):
        since = np.arange(last - first) / RATE_HZ
        pelvis[first:last, 1] += GRAVITY_MS2 / 2 * since * ((last - first) / RATE_HZ - since)
    feet = (joints + pelvis[:, None])[:, list(CONTACT_JOINTS)]
    speed = np.linalg.norm(np.gradient(feet, axis=0), axis=-1) * RATE_HZ
    contacts = (speed < 0.25) & (feet[..., 1] - _RADIUS_M[list(CONTACT_JOINTS)] < 0.05)
    return MocapSequence(
        name, RATE_HZ, R_ZUP_YUP @ R, pose, pelvis @ R_ZUP_YUP.T, contacts.astype(np.float64), leg_length(rest)
    )


def _runs(flags: Array) -> list[tuple[int, int]]:
    """[first, last) of every run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _on_the_floor(joints: Float[Array, "N 24 3"], flies: Array, sigma: float) -> Float[Array, "N 3"]:
    """The pelvis that puts the lowest part on the floor, y = 0, and lets the parts that carry the body rest."""
    clearance = joints[..., 1] - _RADIUS_M
    lowest = clearance.min(axis=1)
    weight = np.exp(-(clearance - lowest[:, None]) / _CONTACT_M)
    moved = np.diff(joints[..., [0, 2]], axis=0)
    step = -(weight[1:, :, None] * moved).sum(axis=1) / weight[1:].sum(axis=1)[:, None]
    for frame in np.flatnonzero(flies[1:]):  # in the air the speed stays that of the take-off
        step[frame] = step[frame - 1] if frame else 0.0
    speed = np.linalg.norm(step, axis=1, keepdims=True) * RATE_HZ
    step *= np.minimum(1.0, FASTEST_MS / np.maximum(speed, 1e-9))
    step = gaussian_filter1d(step, sigma, axis=0, mode="nearest")
    path = np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
    height = -gaussian_filter1d(lowest, sigma, mode="nearest")
    return np.stack([path[:, 0], height, path[:, 1]], axis=1)


def _joint_vectors(posture: Posture) -> Float[Array, "23 3"]:
    """Rotation vectors of all joints but the pelvis, radians, in body24's order."""
    vectors = np.zeros((NUM_JOINTS, 3))
    for side, sign in enumerate((1.0, -1.0)):
        flexion, abduction, knee = posture.legs[side]
        hip = Rotation.from_euler("ZX", [sign * abduction, -flexion], degrees=True)
        level = np.clip(flexion - knee, -40, 30)
        ankle = level if posture.ankles is None else posture.ankles
        elevation, plane, elbow = posture.arms[side]
        arm = Rotation.from_euler("YZ", [-sign * plane, sign * (elevation - 90)], degrees=True)
        vectors[1 + side] = hip.as_rotvec()
        vectors[4 + side, 0] = np.deg2rad(knee)
        vectors[7 + side, 0] = np.deg2rad(ankle)
        vectors[16 + side] = arm.as_rotvec()
        vectors[18 + side, 1] = -sign * np.deg2rad(elbow)
    bend, twist, lean = posture.spine
    for joint in (3, 6, 9):
        vectors[joint] = np.deg2rad([bend / 3, twist / 3, -lean / 3])
    vectors[12, 0] = vectors[15, 0] = np.deg2rad(posture.head / 2)
    return vectors[1:]


def _headed(posture: Posture, heading: float) -> Posture:
    return replace(posture, root=(heading, *posture.root[1:]))


def _kick(rng: np.random.Generator) -> list[Step]:
    fast = rng.uniform(0.16, 0.26)
    turn = float(rng.choice([0, 0, 90, -90, 180, 360]))
    kick = (FRONT_KICK, ROUND_KICK, SIDE_KICK)[int(rng.integers(3))]
    return [
        Step(GUARD, rng.uniform(0.25, 0.5)), Step(_headed(CHAMBER, 0.4 * turn), fast * (1 + abs(turn) / 360)),
        Step(_headed(kick, turn), fast * (1 + abs(turn) / 400)), Step(_headed(CHAMBER, turn), fast),
        Step(_headed(GUARD, turn), rng.uniform(0.2, 0.35)),
    ]  # fmt: skip


def _spin(rng: np.random.Generator) -> list[Step]:
    turns, rate = float(rng.choice([360, 540, 720, 1080])), rng.uniform(360, 720)
    posture = (SPINNER, OPEN_SPIN, REACH)[int(rng.integers(3))]
    seconds = turns / rate
    return [
        Step(_headed(CROUCH, -40), 0.4), Step(_headed(posture, 0.25 * turns), 0.3 * seconds),
        Step(_headed(posture, 0.8 * turns), 0.4 * seconds), Step(_headed(OPEN_SPIN, turns), 0.35 * seconds),
        Step(_headed(STAND, turns), rng.uniform(0.2, 0.5)),
    ]  # fmt: skip


def _jump(rng: np.random.Generator) -> list[Step]:
    air, turn = rng.uniform(0.36, 0.6), float(rng.choice([0, 0, 90, 180, -180, 360]))
    posture = (STAR, TUCK, REACH, LUNGE)[int(rng.integers(4))]
    return [
        Step(CROUCH, rng.uniform(0.3, 0.45)), Step(REACH, 0.14),
        Step(_headed(posture, turn / 2), air / 2, True), Step(_headed(REACH, turn), air / 2, True),
        Step(_headed(CROUCH, turn), 0.16), Step(_headed(STAND, turn), rng.uniform(0.2, 0.5)),
    ]  # fmt: skip


def _floor(rng: np.random.Generator) -> list[Step]:
    down = [Step(SQUAT, 0.5), Step(ALL_FOURS, 0.6)]
    up = [Step(ALL_FOURS, 0.45), Step(SQUAT, 0.6), Step(STAND, 0.5)]
    kind = int(rng.integers(4))
    if kind == 0:
        middle = [Step(PLANK, 0.45)] + [Step(p, rng.uniform(0.35, 0.6)) for p in (PRESS, PLANK, PRESS, PLANK)]
    elif kind == 1:
        other = mirrored(CRAWL)
        middle = [Step(p, rng.uniform(0.35, 0.5)) for p in (CRAWL, other, CRAWL, other)]
    elif kind == 2:
        rolls = [replace(PRONE, root=(0, 90, 0, float(turn))) for turn in (0, 180, 360)]
        middle = [Step(p, rng.uniform(0.5, 0.8)) for p in rolls]
        up = [replace(s, posture=replace(s.posture, root=(*s.posture.root[:3], 360.0))) for s in up]
    else:
        down = [Step(SQUAT, 0.5), Step(SIT, 0.6)]
        middle = [Step(p, rng.uniform(0.45, 0.7)) for p in (SUPINE, SIT_UP, SUPINE, SIT)]
        up = [Step(SQUAT, 0.6), Step(STAND, 0.5)]
    return [*down, *middle, *up]


def _dance(rng: np.random.Generator) -> list[Step]:
    beat, heading, steps = rng.uniform(0.3, 0.55), 0.0, []
    for _ in range(8):
        heading += float(rng.choice([0, 0, 0, 45, -45, 90, -90, 180, 360]))
        flexion = rng.uniform([-10, -10], [45, 45])
        legs = [(f, rng.uniform(0, 24), max(f, 0) + rng.uniform(5, 40)) for f in flexion]
        arms = [(rng.uniform(10, 170), rng.uniform(-20, 100), rng.uniform(0, 115)) for _ in range(2)]
        spine = (rng.uniform(-10, 20), rng.uniform(-25, 25), rng.uniform(-18, 18))
        posture = Posture((legs[0], legs[1]), (arms[0], arms[1]), spine, rng.uniform(-10, 20), (heading, 0, 0, 0))
        steps.append(Step(posture, beat * float(rng.choice([0.5, 1, 1, 1.5]))))
    return steps


def _acrobatics(rng: np.random.Generator) -> list[Step]:
    if rng.random() < 0.6:
        wheel = [replace(WHEEL, root=(0, 0, roll, 0)) for roll in (35.0, 110.0, 180.0, 250.0, 325.0)]
        start, end = Step(replace(WHEEL, legs=LUNGE.legs), 0.4), replace(STAND, root=(0, 0, 360.0, 0))
        return [start, *(Step(p, rng.uniform(0.16, 0.24)) for p in wheel), Step(end, 0.35), Step(end, 0.2)]
    low = replace(ALL_FOURS, root=(0, 120, 0, 0), legs=((60, 3, 20), (60, 3, 20)))
    return [
        Step(SQUAT, 0.5), Step(low, 0.4), Step(HANDSTAND, 0.5), Step(HANDSTAND, rng.uniform(0.3, 0.8)),
        Step(low, 0.45), Step(SQUAT, 0.4), Step(STAND, 0.4),
    ]  # fmt: skip


_ROUTINES: dict[str, Callable[[np.random.Generator], list[Step]]] = {
    "kick": _kick, "spin": _spin, "jump": _jump, "floor": _floor, "dance": _dance, "acrobatics": _acrobatics,
}  # fmt: skip
