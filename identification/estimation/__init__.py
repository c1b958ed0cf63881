"""Estimates of a whole robot from periodic or smoothed runs, and the file that keeps them.

Whether an estimate can be believed is judged in the rooms after this one. Begin with
`periodic_fit.py`.
"""
