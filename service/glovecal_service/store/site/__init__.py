"""A site of several computers: its authority, its members and their certificates."""
