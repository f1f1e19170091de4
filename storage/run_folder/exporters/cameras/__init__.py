"""The cameras alone: trajectories, a COLMAP model, a script for Blender."""
