"""Clips with what real places have: repeated patterns, crowds, passers-by, and cuts of every kind."""
