"""Reads data sets that the user owns: AIST++, Human3.6M, 3DPW, EMDB, RICH."""
