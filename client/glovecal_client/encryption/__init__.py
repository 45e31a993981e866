"""Files on disk are encrypted as long as ``GLOVECAL_ENCRYPTION_KEY_FILE`` names a key."""
