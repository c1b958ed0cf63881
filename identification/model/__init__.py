"""Identifiable parameters of a model: its options, its base parameters, its columns.

This folder uses no data. Start with `base_parameters.py`.
"""
