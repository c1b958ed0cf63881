"""Frequency response, velocity loop and feedforward: the path error cut."""
