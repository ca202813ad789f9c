"""How good the estimate is: accuracy, figures of the paper, comparisons with data from elsewhere."""
