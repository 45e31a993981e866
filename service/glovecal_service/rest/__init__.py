"""REST under /v1: one router file per noun, every error an RFC 9457 problem document."""
