"""Performance experiments: how fast the sweeps are, beside what else there is, and how much of the device they use."""
