"""The science: pure functions, arrays in, arrays out. Knows nothing of Prefect, zarr or paths."""
