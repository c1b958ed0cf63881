"""Estimates of a whole robot from periodic or smoothed runs, and the files that contain them.

The quality of an estimate is assessed in `identification/validation`, `consistency` and `accuracy`.
Start with `periodic_fit.py`.
"""
