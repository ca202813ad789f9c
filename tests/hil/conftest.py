"""Judges of what a guest has recorded. They run where there is no CAN."""

import pytest


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the figures of the tests that passed."""
    for report in terminalreporter.getreports("passed"):
        if report.when == "call" and report.capstdout:
            terminalreporter.write_line("\n    ".join([report.nodeid, *report.capstdout.strip().splitlines()]))
