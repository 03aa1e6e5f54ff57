"""The scheme "regularised": the surface of least energy, which an image, a prior depth and smoothness decide together."""
