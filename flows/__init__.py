"""What runs, in order: Prefect flows over the stages of `humanmm.tasks`."""
