"""What `rid-daq init --urdf` writes: robot file, simulated cell and validation motion of a URDF.

No options and no command line. Begin with `urdf_starter.py`; `simulated_plant.py` makes the motors
and loops that a URDF says nothing of, `starting_cell.py` the drives and their bus.
"""
