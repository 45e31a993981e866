"""Forms whose author was told the laws of all others, and had to find other ones that one may really meet."""
