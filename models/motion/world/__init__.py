"""Aligns all shots into one world: their rotations, then positions, scale and floor (section 3.3)."""
