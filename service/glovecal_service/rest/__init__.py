"""REST under /v1: a folder per noun with its routers, every error an RFC 9457 problem document."""
