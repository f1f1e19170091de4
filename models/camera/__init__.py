"""Point tracks, intrinsics, masked visual odometry and its cross-checks (paper section 3.2)."""
