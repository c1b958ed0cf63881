"""What the service keeps over a restart: one SQLite file, one class a table. Nothing else does SQL.

Every write is on the disk before it is answered (WAL, synchronous FULL). Begin with `database.py`.
"""
