"""What can be identified of a model: its options, its base parameters, its columns.

No data yet. Begin with `base_parameters.py`.
"""
