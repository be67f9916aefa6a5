"""Bending from loops, strips that hang, heart loops and numbers of KES."""
