"""What there is, and what to do next."""
