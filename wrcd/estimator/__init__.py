"""Pure arithmetic: design file, bank, residuals, fuzzy inference, estimate. No clock, no bus, numpy only."""
