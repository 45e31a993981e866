"""Where a model fails: what its errors depend on, and how small they could get."""
