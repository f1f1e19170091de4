"""Joint rotations of the fingers from the landmarks of hands."""
