"""Contact of a sheet with bodies and with itself, with friction: terms like any other, for whatever solver."""
