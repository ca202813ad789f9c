"""What sand is worth: one stop on every rail by every sanding policy."""
