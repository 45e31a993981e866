"""Physical effects: ``/v1/effects``, and diagnosis, changes and improvement of models."""
