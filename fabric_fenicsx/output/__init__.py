"""Histories, fields, pictures, plots."""
