"""Operations: what the program does, each declared once in a file of its own."""
