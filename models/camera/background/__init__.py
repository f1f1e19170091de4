"""Key frames of the background: edges between the cameras of shots that show one place, and what its walls tell."""
