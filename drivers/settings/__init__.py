"""Files with drive settings, from which the settings can be restored; no communication.

The modules define which objects are settings, log overwritten values, and define the order of
restoring. `drivers/servo/drive_settings.py` communicates with the drives. Begin with
`saved_drive.py`.
"""
