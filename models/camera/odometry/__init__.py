"""Visual odometry over the key frames of a shot: two-view geometry, resection, bundle adjustment."""
