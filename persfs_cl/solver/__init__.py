"""From an image to its depth: the problem, the iteration, and the equations in plain NumPy."""
