"""Three other estimation methods on the same data, and their agreement with the estimate.

Each method solves the robot's equations in a different form. Start with `agreement.py`.
"""
