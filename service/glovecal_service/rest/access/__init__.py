"""Keys, people, the login of the studio, and the log of changes."""
