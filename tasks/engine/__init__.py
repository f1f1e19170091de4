"""Computes one stage × unit of a video or finds it in the store: units, keys, plan, execution, end of a run."""
