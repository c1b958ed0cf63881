"""`RobotModel`: all terms of a robot, and what is computed with them.

Free functions on an immutable model; nothing is estimated here. Begin with `robot_model.py`.
"""
