"""Drawing of a robot: the scene for the browser, and still pictures for reports.

This package knows no operation, no run and no page. Nothing that is drawn here is used to check a
clearance. Begin with `scene.py`.
"""
