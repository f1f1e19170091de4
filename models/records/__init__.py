"""Frozen dataclasses that stages exchange. They import nothing else of the package but errors."""
