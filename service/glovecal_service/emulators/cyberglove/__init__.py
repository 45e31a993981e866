"""An emulated CyberGlove I/II control box and its counts."""
