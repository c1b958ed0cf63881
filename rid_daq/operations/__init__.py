"""Operations of the program, each declared once in its own file. Begin with `catalogue.py`."""
