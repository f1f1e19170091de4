"""Drivers of the benchmarks and of the data sets that they need."""
