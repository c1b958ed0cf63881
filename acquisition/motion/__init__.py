"""Motions as rows: every kind planned, timed, held against limits and collisions.

From a motion file to `MotionSamples`; nothing is sent from here. Begin with `samples.py`, then
`motion_file.py`. It lists the kinds, which stand in `kinds`, a file each; `paths` is what those
share that follow a path.
"""
