"""`sim-ecu completion`."""

from wrcd.cli.completion import completion_of

COMMAND = completion_of("sim-ecu")
