"""The lifter: what a pose network sees of a person over time → landmarks in space, joint rotations, and how sure."""
