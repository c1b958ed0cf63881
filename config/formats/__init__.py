"""Bytes to trees: YAML, JSON, XML, URDF and EDS, read within bounds and with file and line.

Formats alone; what a key means stands in the rooms of the schemas. Begin with `bounded_file.py`,
which every reader goes through, and `yaml_tree.py`.
"""
