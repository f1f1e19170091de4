"""Metrics of the paper and of the field, as pure functions."""
