"""Operations on run folders."""
