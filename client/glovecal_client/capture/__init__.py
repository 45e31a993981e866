"""Capture: devices, the daemon that records and publishes their frames, and its command."""
