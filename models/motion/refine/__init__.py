"""Smooths the world motion, removes discontinuities at cuts, and keeps standing feet in place (section 3.4)."""
