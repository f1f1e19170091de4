"""The run folder: motion.zarr, run.json, exports, and the video files beside them."""
