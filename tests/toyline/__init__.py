"""A whole pipeline that computes next to nothing: real result classes, a text file as its video.

Tests copy this folder somewhere and change it there. The "video" is json: {"num_frames": 60, "cuts": [20, 40]}.
Environment: TOY_LOG names a file to which every execution adds a line; TOY_FAIL `camera:20=stage` makes the unit that
begins at frame 20 fail (`=stage:1` once), `=disk:2` fail twice for the disk's sake (`=memory:1` once for lack of
memory), `=input` be bad input, `=bug` be a defect; TOY_SLEEP `people=0.5`; TOY_CUTS `20,41`.
"""
