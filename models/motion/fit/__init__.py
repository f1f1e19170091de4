"""Fits the body to the 2D keypoints and 3D landmarks of one shot: pose, shape, orientation and depth in camera axes."""
