"""What lies in a user's PYTHONPATH: not the locked package of this name."""

raise ImportError(__doc__)
