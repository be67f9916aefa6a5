"""Equilibrium and motion: PETSc's SNES and TS, continuation, energies, checkpoints."""
