"""Demo: the complete workflow on the bundled cell, compared with the simulation's true values.

The demo calls the modules of the operations; only the command `demo` uses this package. Begin with
`demo.py`.
"""
