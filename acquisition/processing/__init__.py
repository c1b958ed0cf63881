"""Processing of recordings: mean periods, smoothing, and alignment of force-plate rows.

No parameters of a robot are estimated here. Begin with `periods.py`.
"""
