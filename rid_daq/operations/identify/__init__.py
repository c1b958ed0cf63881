"""Operations that estimate, validate, compare and export models of a robot."""
