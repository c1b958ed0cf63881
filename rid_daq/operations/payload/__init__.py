"""Operations on payloads: identify them from runs, and hand them on."""
