"""What is checked before a motion, as lines that are red or not.

Each file asks one device or this computer; what a drive must hold stands in `drivers/servo`. Begin
with `preflight.py`.
"""
