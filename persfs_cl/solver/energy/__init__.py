"""The scheme "regularised": the surface of least energy, which image, prior depth and smoothness decide together."""
