"""The rotations of all shots against one another and gravity, decided together from all that speaks of them."""
