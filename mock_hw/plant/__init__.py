"""The simulated robot, computed by Pinocchio with effects that our models do not have.

Independent of `dynamics`, so that a shared mistake cannot cancel. Begin with `plant.py`.
"""
