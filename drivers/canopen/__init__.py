"""A small sans-IO CANopen core (CiA 301), used by the driver and by the simulated drive."""
