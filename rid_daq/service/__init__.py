"""The service: cells with a door. Jobs, leases, roles and the API; `client.py` for programs.

A job runs in a process of its own (`rid_daq.worker`), so that a stop needs no living server.
Begin with `service.py`; decision 0042 says why.
"""
