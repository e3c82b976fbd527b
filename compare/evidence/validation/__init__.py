"""``compare validation``: every shipped case in every engine, stored as a report, and whether it still holds."""
