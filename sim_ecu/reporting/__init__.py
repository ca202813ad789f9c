"""What the rig shows: values, tables, verdicts, pictures and pages. No other room makes any."""
