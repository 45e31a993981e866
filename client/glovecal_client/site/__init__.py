"""A site whose members know each other: who may do what, and the file with which one proves who it is."""
