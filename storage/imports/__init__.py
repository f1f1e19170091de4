"""Readers of other systems' results, for side-by-side rows of the benchmark. Nothing in them is ever executed."""
