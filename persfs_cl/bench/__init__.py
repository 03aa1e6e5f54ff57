"""Experiments: how fast the sweeps are, against baselines and the device's limits, and how exact the depth is."""
