"""Cell, robot, motion and plant files: schemas, loader, bundled examples, the error tree.

The lowest floor: it imports nothing of ours. No device, no clock and no numerics beyond what a file
needs to be checked. Begin with `config/errors.py`, then `config/load.py`.
"""
