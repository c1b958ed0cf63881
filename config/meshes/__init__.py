"""Meshes of a robot's links: search for the files, triangles in metres, convex hulls around them.

It knows no robot file; `config.robot` makes bodies of the hulls. Begin with `mesh_file.py`.
"""
