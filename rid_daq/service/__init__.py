"""Service that lets browsers and programs control cells over HTTP: jobs, leases, roles and the API.

Every job runs in its own process (`rid_daq.worker`), so that a stop works even if the service
hangs. `service.py` is the entry point, `client.py` the client for programs; decision 0042 gives the
reasons.
"""
