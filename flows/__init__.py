"""Prefect flows: what runs, in order, over the stages of `humanmm.tasks`."""
