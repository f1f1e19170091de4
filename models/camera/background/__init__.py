"""Key-frame features of the background, and the edges between the cameras of shots that show one background."""
