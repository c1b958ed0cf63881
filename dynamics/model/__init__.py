"""`RobotModel`: all terms of a robot, and computations with them.

A model is immutable; this package evaluates models and estimates nothing. Begin with
`robot_model.py`.
"""
