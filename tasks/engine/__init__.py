"""One run on one video: what would be computed, what is, within which memory and threads, and the run folder."""
