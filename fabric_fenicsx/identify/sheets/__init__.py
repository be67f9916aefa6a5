"""Sheets of KES-F and FAST, from numbers and from curves."""
