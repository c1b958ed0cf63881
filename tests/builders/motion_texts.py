"""Motion files as text: multisines for the velocity loops, and paths."""

CIRCLE = """
kind: circle
robot: ir361
centre_m: [0.575, -0.078, -1.724]
radius_m: 0.2
speed_m_s: 0.6
near: [0.1, -0.1, 0.4]
periods: 4
transient_periods: 1
ramp_s: 1.0
"""
MULTISINE = """
kind: multisine
robot: ir361
period_s: 4.0
lowest_hz: 0.75
highest_hz: 15.0
realisations: 2
periods: 2
ramp_s: 1.0
joints:
- {joint: axis1, velocity: 0.05, slow_amplitude: 0.1}
- {joint: axis2, velocity: 0.04, slow_amplitude: 0.1}
- {joint: axis3, velocity: 0.06, slow_amplitude: 0.1}
"""
PICK = """
kind: joint_path
robot: ir361
points: [[-0.5, 0.3, 0.2], [0.0, 0.0, 0.4], [0.5, 0.3, 0.2]]
"""
