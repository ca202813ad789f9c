"""What is to be believed: the sensors' health, what is remembered of the rail, how wide the interval must be."""
