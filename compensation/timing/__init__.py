"""How fast a path may be driven: the fastest timing that the torques of a model allow.

Nothing here knows velocity loops, cells or files. Begin with `timed_path.py`; decision 0043 says
why it is so.
"""
