"""CyberGlove III over USB or WiFi, and the recordings on its memory card."""
