"""Drive settings, stored in files so that they can be restored: no bus, no port.

These files define which objects are settings, which values were overwritten, and the order of
restoring. `drivers/servo/drive_settings.py` communicates with drives. Begin with `saved_drive.py`.
"""
