"""What `rid-daq init --urdf` writes: robot file, simulated cell and validation motion of a URDF.

No options and no command line. Begin with `urdf_starter.py`; `workload.py` makes limits that the
motors hold, `simulated_plant.py` the motors and loops that a URDF says nothing of,
`starting_cell.py` the drives and their bus, `touching_bodies.py` pairs that are not held apart.
"""
