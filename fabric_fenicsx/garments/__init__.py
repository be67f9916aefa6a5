"""Garments: flat panels, seams that join them, and the wearer whom they dress."""
