"""STOP requests: identification of the sender, HTTP endpoints, and a WebSocket for STOP alone."""
