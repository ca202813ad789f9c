"""A vehicle's constants from its signals: the bogie as transfer functions, calm stretches of a log, and the fit."""
