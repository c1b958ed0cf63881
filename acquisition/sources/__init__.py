"""Recordings that are not text tables: each becomes a CSV file and the import map that reads it.

`bags.py` reads the joint states of ROS bags. `array_files.py` reads MAT, NPZ, HDF5 and Parquet
files, `message_files.py` the messages of MCAP files and bags of any type; `array_tables.py` writes
the arrays that a map names.
"""
