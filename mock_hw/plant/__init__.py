"""The simulated robot, computed by Pinocchio, with effects that the estimators do not model.

This package does not use `dynamics`, so that a mistake in one package cannot be hidden by the same
mistake in the other. Begin with `plant.py`.
"""
