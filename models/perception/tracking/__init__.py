"""Finds and tracks everybody through one scene: search, tracks, links between tracks, left and right."""
