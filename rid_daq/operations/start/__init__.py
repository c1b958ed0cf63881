"""Operations with which a person starts: the demo, files to begin with, the documentation."""
