"""A site whose members know each other: who may do what there, and the file with which one proves who it is."""
