"""Records of a known fabric, with noise."""
