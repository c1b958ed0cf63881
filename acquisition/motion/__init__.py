"""Motions: planning, timing, and checks of limits and collisions.

The code converts a motion file to `MotionSamples`; nothing is sent to the drives. Begin with
`samples.py`, then `motion_file.py`, which lists the kinds of motion. `kinds` has one file per kind,
`paths` has the common code of kinds that follow a path.
"""
