"""The focal lengths of a video: one for all shots, and those of shots that clearly have a lens of their own."""
