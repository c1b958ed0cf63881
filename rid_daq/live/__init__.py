"""Live page: shows a motion in a browser, with a stop button."""
