"""Pictures of a result: overlay, view from above, timeline, and the rasteriser that draws bodies."""
