"""How the shipped networks are trained: what they are trained for, and the steps."""
