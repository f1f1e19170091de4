"""Cast shadows: the floor around people from above, and the directions of the light that explain what is dark on it."""
