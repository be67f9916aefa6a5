"""What the residual is made of: laws at points, the internal work, forms of loads, supports."""
