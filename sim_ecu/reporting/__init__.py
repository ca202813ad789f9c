"""What the rig shows: values, tables, verdicts."""
