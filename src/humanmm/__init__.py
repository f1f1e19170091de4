"""One continuous human motion in one metric world, from a video with cuts (HumanMM, CVPR 2025)."""

__version__ = "0.1.0"
