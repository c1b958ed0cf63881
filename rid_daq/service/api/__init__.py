"""Version 1 of the service's API: REST routes and one WebSocket.

A route only turns a request into a function call, and the result into a record. A test compares the
API with `docs/reference/openapi.json`, so that the API does not change unnoticed. Begin with
`app.py`.
"""
