"""OpenCyberGlove: binary packets with a checksum."""
