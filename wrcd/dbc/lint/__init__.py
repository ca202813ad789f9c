"""`wrcd lint`: what a DBC says that loading lets pass, and that costs frames, values or the estimate."""
