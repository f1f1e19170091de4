"""What runs the shipped networks of one picture: LiteRT on the processor, torch on a CUDA device."""
