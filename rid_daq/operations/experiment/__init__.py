"""Operations before an estimate: design a motion, import a recording, average its periods."""
