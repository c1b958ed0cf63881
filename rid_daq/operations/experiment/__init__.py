"""Operations before an estimate: design, record and import motions, average periods."""
