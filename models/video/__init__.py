"""Reads containers and decodes frames, streaming: facts, frames, colours, prefetch."""
