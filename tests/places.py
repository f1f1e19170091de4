"""Made-up places that a camera films, small enough for the detectors of cuts."""

from functools import lru_cache

import cv2
import numpy as np

from humanmm.models.shot_detection.picture_window import SIDE_PX

WIDTH, HEIGHT = SIDE_PX, SIDE_PX * 9 // 16


class Place:
    """A made-up place: coloured shapes on a large wall, over which a camera looks and an actor walks."""

    def __init__(self, seed: int) -> None:
        generator = np.random.default_rng(seed)
        self.wall = np.full((3 * HEIGHT, 6 * WIDTH, 3), generator.integers(40, 200, 3), np.uint8)
        for _ in range(400):
            x, y = generator.integers(0, self.wall.shape[1]), generator.integers(0, self.wall.shape[0])
            size, color = int(generator.integers(4, 24)), [int(c) for c in generator.integers(0, 255, 3)]
            if generator.random() < 0.5:
                cv2.circle(self.wall, (int(x), int(y)), size // 2, color, -1)
            else:
                cv2.rectangle(self.wall, (int(x), int(y)), (int(x) + size, int(y) + size // 2), color, -1)
        self.noise = generator
        self.actor = [int(c) for c in generator.integers(0, 255, 3)]

    def picture(self, time: int, offset: tuple[float, float] = (0, 0), blur: float = 0) -> np.ndarray:
        """The camera's picture at a time, looking `offset` pixels away from its rest."""
        x, y = 2.5 * WIDTH + offset[0], HEIGHT + offset[1]
        shift = np.array([[1, 0, -x], [0, 1, -y]])
        picture = cv2.warpAffine(self.wall, shift, (WIDTH, HEIGHT), borderMode=cv2.BORDER_REFLECT)
        left = int(20 + 1.5 * time)
        cv2.rectangle(picture, (left, HEIGHT // 3), (left + 14, HEIGHT - 8), self.actor, -1)
        if blur >= 1:
            picture = cv2.blur(picture, (int(blur), 1))
        noisy = picture + self.noise.normal(0, 2, picture.shape)
        return np.clip(noisy, 0, 255).astype(np.uint8)

    def still(self, count: int) -> list[np.ndarray]:
        return [self.picture(t) for t in range(count)]


def marbled(offset_px: float) -> np.ndarray:
    """What a camera sees that looks `offset_px` to the right along a wall of soft colours, without any noise."""
    shift = np.array([[1.0, 0, -offset_px], [0, 1, 0]])
    return cv2.warpAffine(_marble(), shift, (WIDTH, HEIGHT), flags=cv2.INTER_CUBIC)


@lru_cache(maxsize=1)
def _marble() -> np.ndarray:
    wall = np.random.default_rng(0).integers(0, 255, (HEIGHT, 4 * WIDTH, 3), np.uint8)
    return cv2.normalize(cv2.GaussianBlur(wall, (0, 0), 4), None, 0, 255, cv2.NORM_MINMAX)  # type: ignore[call-overload]
