"""Operations on the settings of drives: back up, restore, undo, and fit a data sheet."""
