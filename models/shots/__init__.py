"""The three-part shot detector (paper section 3.1) and who is who across cuts."""
