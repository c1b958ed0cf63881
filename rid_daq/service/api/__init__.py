"""Version 1 of the service's API: REST and one WebSocket; the rules are in the packages below.

Begin with `app.py`. A route only turns a request into a function call and the result into a record.
`docs/reference/openapi.json` freezes the API.
"""
