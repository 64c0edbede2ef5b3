"""compstiff: from measured loads and deflections to a compliance model with its covariance."""
