"""Light, material and the two together: what a user states, and which kernels stand for it."""
