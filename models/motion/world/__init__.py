"""Aligns all shots into one world: camera rotations, gravity, positions, scale and floor (section 3.3)."""
