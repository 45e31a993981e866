"""CyberGlove I and II on a serial port: the control box, its records, and the search for its port."""
