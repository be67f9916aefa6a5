"""Tensile tests: from records, dots and photographed yarns to curves and ratios; strips of any angle, simulated too."""
