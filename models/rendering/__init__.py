"""Pictures of people with an exact truth: procedural sets, dressed bodies, cameras, a software rasteriser."""
