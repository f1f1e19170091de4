"""Metrics of one motion against its truth, as the field defines them."""
