"""What a log tells: columns, events, statistics and a verdict. Report, plot, why and monitor read a Story."""
