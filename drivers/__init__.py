"""Device communication: transport, CANopen, CiA 402 drives; `open_cell`."""
