"""Worker: the process that executes one job of a service and writes its events.

It starts its job when the service sends it, takes orders from the service only, and ends its job if
the service is gone. Begin with `worker.py`.
"""
