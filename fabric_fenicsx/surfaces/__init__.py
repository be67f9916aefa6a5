"""Surfaces that a sheet is made of: read, checked, and with their warp and weft."""
