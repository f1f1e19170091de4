"""The permissive 24-joint body: shape, forward kinematics, and the landmarks on its surface."""
