"""Short codes of tiny images whose distances foretell image distances: a look-up compares the best only."""
