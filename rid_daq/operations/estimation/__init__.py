"""Estimates of a robot from its runs, with the checks of their result."""
