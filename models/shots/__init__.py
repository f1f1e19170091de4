"""Splits a video into scenes and shots, identifies people across cuts, and finds left-right swaps (section 3.1)."""
