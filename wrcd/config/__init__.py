"""The names that a configuration gives, found in the DBC: which signals carry what, which messages to send."""
