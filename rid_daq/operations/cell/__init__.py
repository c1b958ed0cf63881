"""Operations on a cell: check, reset, manual motion. Declarations import no numerical libraries."""
