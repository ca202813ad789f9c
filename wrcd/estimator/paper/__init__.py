"""The paper's method: the bank of filters, the windowed RMS of their residuals, the fuzzy system."""
