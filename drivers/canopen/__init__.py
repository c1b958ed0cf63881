"""CANopen messages (CiA 301), without input or output: for drivers and simulated drives."""
