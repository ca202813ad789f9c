"""`wrcd check --log` and `--live`: what a bus gives a configuration, and what would stop Valid."""
