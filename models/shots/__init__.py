"""Shots of a video with everybody in them: people identified across cuts, and left-right swaps found (section 3.1)."""
