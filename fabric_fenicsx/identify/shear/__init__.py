"""Shear from picture frames, and its friction from several cycles."""
