"""What simulated hardware needs of its computer: processes, sockets' folders, faults of programs.

No device. Begin with `device_process.py`.
"""
