"""Training of the shipped networks: sets of pairs, the lifter, its card."""
