"""Feedforward of a motion that is known in advance: compute, refine, evaluate and store it.

Everything here runs before the motion. Begin with `inverse.py`.
"""
