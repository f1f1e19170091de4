"""The benchmark: multi-shot videos made from motion capture, the methods that are compared, and their figures."""
