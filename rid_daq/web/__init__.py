"""Web server: limits for clients, protection against unknown web pages, feed for viewers."""
