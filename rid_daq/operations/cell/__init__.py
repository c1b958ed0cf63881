"""Operations on a cell: check, reset, motions by hand. A declaration imports no numerics."""
