"""Cell file: buses, drives, safety, supervision, force plate, monitor, data sheets.

It defines what a file may state; `drivers/servo` checks what a drive does. Begin with `cell.py`.
"""
