"""Rotations, projection, boxes, alignment, intervals, chains: each once, used by all."""
