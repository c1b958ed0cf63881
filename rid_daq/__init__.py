"""The program `rid-daq`: command line, sessions, reports, service and workbench."""
