"""Key frames of the background: edges between the cameras of shots of one place, directions of its walls, and pictures
of the ground."""
