"""STOP's own path through the service: admission, the HTTP requests, the WebSocket."""
