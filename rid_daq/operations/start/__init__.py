"""Operations with which a person starts: the demo, files to begin with, the documentation.

`urdf_starter.py` makes the files of `init --urdf`; `workload.py` makes limits that the motors hold,
`simulated_plant.py` the motors and loops that a URDF does not state, `starting_cell.py` the drives
and their bus, `touching_bodies.py` pairs that are not held apart, `starter_rehearsal.py` the trial.
"""
