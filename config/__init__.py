"""Cell, robot, motion and plant files: schema, loader, bundled examples, the error tree."""
