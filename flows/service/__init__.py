"""The processes of `humanmm serve`: the service, its worker, and one process for each video."""
