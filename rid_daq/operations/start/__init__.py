"""Operations for a new user: the demo, example files, the documentation.

`urdf_starter.py` makes the files of `init --urdf`. `workload.py` computes limits that the motors
can keep, `simulated_plant.py` the motors and loops that a URDF does not state, and
`starting_cell.py` the drives and their bus. `touching_bodies.py` finds pairs of bodies that nearly
always touch. `starter_rehearsal.py` checks and moves the new cell once in simulation.
"""
