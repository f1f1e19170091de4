"""Sequences with exact truth made from motion capture: cameras, backgrounds and the noise of a detector."""
