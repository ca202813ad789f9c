"""Figures over traces. Only Valid frames are judged: what is not Valid is counted beside."""
