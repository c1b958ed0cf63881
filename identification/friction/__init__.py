"""Friction measured separately: curves from constant speeds, and the motions for them.

The model's friction terms are in `dynamics/terms`. Start with `experiments.py`.
"""
