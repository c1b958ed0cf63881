"""Friction alone: curves from constant speeds, and the motions that show them.

The model's friction terms stand in `dynamics/terms`. Begin with `experiments.py`.
"""
