"""The harness: the analytic model against the engines, as a command, a table and a report."""

import compare.report.presentations  # noqa: F401 - so that a result can be shown, whoever made it
