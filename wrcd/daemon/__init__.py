"""The loop and what keeps it honest: the only place that knows both the bus and the estimator."""
