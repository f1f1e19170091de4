"""Finds people in pictures, tracks them, and estimates their 2D keypoints, 3D landmarks and silhouettes."""
