"""Cast shadows: the ground around people, and the directions of the light that explain what is dark on it."""
