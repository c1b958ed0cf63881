"""A model held against another motion, and what its errors follow.

What the data say about an estimate; the estimators stand in `identification/estimation`. Begin with
`torque_prediction.py`.
"""
