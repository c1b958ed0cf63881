"""The simulated robot, computed by Pinocchio, with effects that simple models lack.

This package does not use `dynamics`, so that a mistake in one package cannot be hidden by the same
mistake in the other. Begin with `plant.py`.
"""
