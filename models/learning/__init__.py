"""Training of the shipped networks: pairs of what the pose networks see of rendered people and what is true."""
