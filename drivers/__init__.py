"""Communication with devices: buses and ports, CANopen, CiA 402 drives, force plate, Modbus."""
