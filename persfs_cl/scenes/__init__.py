"""Surfaces whose depth is known exactly."""
