"""From photographs of a marked specimen to the file of its marks, which `identify` reads."""
