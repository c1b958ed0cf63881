"""Kinematic calibration: geometry and gear compliance from measured positions of one point.

`calibration.py` is the whole procedure; it fits (`fit.py`) the identifiable parameters
(`parameters.py`) of an arm in the frame of the instrument (`arm.py`), whose gears bend under
gravity (`gravity.py`), and judges the result by poses left out of the fit (`held_out.py`).
`pose_design.py` proposes poses. Stiffness from motions belongs elsewhere. Start reading at
`arm.py`.
"""
