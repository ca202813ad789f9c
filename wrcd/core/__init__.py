"""Pure: ticks, inputs, validity, messages out, counts. No clock, no operating system."""
