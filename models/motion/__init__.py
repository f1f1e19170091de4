"""Human motion: per-shot fit, alignment across cuts (paper section 3.3), refinement (section 3.4)."""
