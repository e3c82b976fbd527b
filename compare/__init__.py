"""The harness: the analytic model against the engines, as a command, a table and a report."""
