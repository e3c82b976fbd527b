"""Every shipped case in every engine, published figures beside them: stored as a report, and whether it still holds."""
