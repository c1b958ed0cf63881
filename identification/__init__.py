"""Base parameters, experiment design, estimators, validation and payloads.

The science of the program: no device, no terminal. Its rooms build on one another, `regression`
first; begin with `regression/least_squares.py`, then `estimation/periodic_fit.py`.
"""
