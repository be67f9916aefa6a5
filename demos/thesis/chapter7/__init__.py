"""The rooms of thesis.py: what is run (statics, motion, points), how (cases), and what is said of it (the others)."""
