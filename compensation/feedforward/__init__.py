"""Feedforward of a known motion: compute, refine, judge, and store it.

Everything here runs before the motion. Begin with `inverse.py`.
"""
