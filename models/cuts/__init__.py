"""The rotation of the camera across a cut, from the people seen on both sides (paper section 3.3.1)."""
