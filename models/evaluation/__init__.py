"""Figures of merit of a recovered motion against its truth, as the field defines them: arrays in, numbers out."""
