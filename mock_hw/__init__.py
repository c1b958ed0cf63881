"""Simulated hardware with real byte streams: robot, drives, CAN bus, force plate, processes."""
