"""Checks before a motion; each result is a line that can be red.

Each file checks one device or this computer. The values that a drive must contain are defined in
`drivers/servo`. Begin with `preflight.py`.
"""
