"""Reads foreign files: truths, results of other systems, motion capture packs."""
