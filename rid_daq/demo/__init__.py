"""The demo: the whole mission on the bundled cell, held against the simulation's truth.

It uses the jobs; nothing uses it but its command. Begin with `demo.py`.
"""
