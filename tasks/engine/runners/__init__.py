"""Where a unit is computed: in a child process, or on workers of Dask or Ray."""
