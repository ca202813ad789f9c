"""The terminal's side of the monitor, by Textual. Nothing else imports that."""
