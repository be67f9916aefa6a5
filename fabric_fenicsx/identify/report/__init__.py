"""What is told of an identified fabric, in pictures and words."""
