"""Motions as rows: every kind planned, timed, held against limits and collisions.

From a motion file to `MotionSamples`; nothing is sent from here. Begin with `samples.py`, then
`plan.py`.
"""
