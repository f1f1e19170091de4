"""The stages, one file each: read inputs, call one pure function of `humanmm.models`, return its result."""
