"""Splits a video into scenes and shots, tells who is who across cuts, and finds left-right swaps (section 3.1)."""
