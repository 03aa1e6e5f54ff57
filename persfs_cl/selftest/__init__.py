"""Whether a device computes what it should: the kernels beside the NumPy reference, in a process of their own."""
