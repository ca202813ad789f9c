"""The reference engine: what the train computes, by filterpy, scipy and scikit-fuzzy, with no code in common."""
