"""One effect, tried on a model's takes beside its control."""
