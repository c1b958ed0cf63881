"""The API of the service, version 1: REST, one WebSocket. Rules are in the rooms below.

Begin with `app.py`. A route does nothing but turn a request into a call, and what comes back into
a record. What it promises is frozen in `docs/reference/openapi.json`.
"""
