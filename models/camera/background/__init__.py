"""Key frames of the background: edges between the cameras of shots of one place, and directions of its walls."""
