"""Simulated hardware on real byte streams: plant, drives, CAN bus, processes."""
