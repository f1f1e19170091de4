"""What the shipped networks are trained on: pairs of what the pose networks see of rendered people and what is true."""
