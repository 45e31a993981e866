"""What takes could have shown: effects of known size put into the user's own session, and diagnosed again."""
