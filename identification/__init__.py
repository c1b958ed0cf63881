"""Base parameters, experiment design, estimators, validation and payloads.

This package contains the computations of the program, without devices and terminals. Its folders
build on one another, starting with `regression`. Start with `regression/least_squares.py`, then
`estimation/periodic_fit.py`.
"""
