"""One file a stage: read inputs from the store, call one pure function of `humanmm.models`, return its result."""
