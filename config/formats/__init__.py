"""Reading of YAML, JSON, XML, URDF and EDS of limited size; errors name the line or the key.

This package defines file formats only; the schemas in the rest of `config` define the meaning of
keys. Begin with `bounded_file.py`, by which most files are read, and `yaml_tree.py`.
"""
