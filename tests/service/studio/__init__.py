"""A package, so that its service and its browser end with the last of its tests."""
