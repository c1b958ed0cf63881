"""Operations on payloads: identify a payload from runs, certify it, write load data."""
