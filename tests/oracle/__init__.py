"""The oracle: what the estimator in C computes, by filterpy, scikit-fuzzy, scipy and numpy, with no code in common."""
