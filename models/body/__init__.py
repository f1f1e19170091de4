"""The 24-joint body: forward kinematics, skinning, landmarks."""
