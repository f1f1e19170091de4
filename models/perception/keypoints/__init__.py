"""Keypoints of a person in a crop: two pose networks fused, then refined by what their inner layers show."""
