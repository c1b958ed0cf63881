"""Validation of a model on other motions, diagnosis of its errors, and choice of model terms.

The estimators are in `identification/estimation`. Start with `torque_prediction.py`.
"""
