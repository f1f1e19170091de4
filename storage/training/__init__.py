"""What the training of networks keeps on a disk: sets of pairs, checkpoints, and the network that is delivered."""
