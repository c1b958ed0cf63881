"""State of the service that survives a restart: one SQLite file, one class per table.

Only this package contains SQL. A write is on the disk before the service answers (WAL, synchronous
FULL). Begin with `database.py`.
"""
