"""The simulated robot, computed by Pinocchio, with effects that the estimators' models do not have.

This package is independent of `dynamics`, so that no mistake is in both and cancels. Begin with
`plant.py`.
"""
