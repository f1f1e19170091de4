"""Where a unit is computed: in this process, in a child process, or on workers of Dask or Ray."""
