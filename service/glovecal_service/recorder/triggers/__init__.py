"""Triggers: recordings that begin and end with those of other systems, in either direction, over UDP."""
