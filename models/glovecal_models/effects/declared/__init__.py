"""declared effects: a user's own, from one line of text."""
