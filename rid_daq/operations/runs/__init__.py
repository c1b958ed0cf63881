"""Operations on run folders: list and verify runs, recover damaged recordings."""
