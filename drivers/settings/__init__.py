"""What drives hold, kept in files so that it can be put back: no bus, no port.

Which objects are settings, what was written over them, in which order they are restored. What
talks to drives is `drivers/servo/drive_settings.py`. Begin with `saved_drive.py`.
"""
