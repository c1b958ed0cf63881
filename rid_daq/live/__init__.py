"""The live page: what a motion is doing, in a browser, with a stop button."""
