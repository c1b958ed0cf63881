"""Conversion of bytes to trees: YAML, JSON, XML, URDF and EDS, size-limited, with line numbers.

Only file formats; the meaning of keys is defined by the schemas elsewhere in `config`. Begin with
`bounded_file.py`, which every reader uses, and `yaml_tree.py`.
"""
