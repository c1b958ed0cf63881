"""The cell file: buses, drives, safety, supervision, force plate, monitor, data sheets.

What a file may say; whether a drive obeys is found out in `drivers/servo`. Begin with `cell.py`.
"""
