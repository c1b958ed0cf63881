"""What people see of the sections of a result, as blocks."""
