"""Renders pictures of synthetic sequences: actors, clothing, background scene, cameras."""
