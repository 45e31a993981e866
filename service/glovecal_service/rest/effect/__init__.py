"""Physical effects: ``/v1/effects``, one of them on trial, and its picture."""
