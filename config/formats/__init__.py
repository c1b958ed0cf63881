"""Conversion of bytes to trees: YAML, JSON, XML, URDF and EDS, size-limited, with line numbers.

This package defines file formats only; the schemas in the rest of `config` define the meaning of
keys. Begin with `bounded_file.py`, which every reader uses, and `yaml_tree.py`.
"""
