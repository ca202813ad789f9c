"""A replay for the tools of the field: MDF 4 and MCAP, with units, words and time stamps."""
