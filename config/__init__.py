"""Cell, robot and plant files: schemas, loader, bundled examples; and all error classes.

Lowest package: it imports no other package of rid-daq. It contains no device, and only the numerics
that checking a file needs. Begin with `config/errors.py`, then `config/load.py`.
"""
