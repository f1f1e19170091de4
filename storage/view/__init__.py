"""The recording to look at: one HTML page with the video beside the world in 3D, and a file for rerun's viewer."""
