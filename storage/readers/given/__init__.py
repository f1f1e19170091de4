"""What other programs found of a video, in place of a stage's own result: one reader a kind of file."""
