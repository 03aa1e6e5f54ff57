"""Whether a device computes what it should: the kernels against the NumPy reference, in a process of their own."""
