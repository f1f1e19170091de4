"""Methods that are compared, oracles, and their scores on one sequence."""
