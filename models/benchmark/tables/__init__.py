"""Tables of a benchmark: rows, statistics, layout, the paper's own figures, drawings."""
