"""Data of the 3-D view for the pages: the robot's scene, its pose at rest, and planned motions.

The geometry is in `rid_daq/robot_view`, the drawing in `static/robot_view.js` of the workbench.
Begin with `scene_routes.py`.
"""
