"""Operations on a cell: check, reset, manual motion. Declaring them imports no numerics."""
