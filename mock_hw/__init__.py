"""Simulated hardware that exchanges real bytes: robot, drives, CAN bus, force plate, registers."""
