"""Kinematics of the sheet, Chapter 5: strains, directors that turn, elements that do not lock."""
