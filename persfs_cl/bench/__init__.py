"""Experiments: how fast the sweeps are, beside what else there is and the device's limits; how exact the depth is."""
