"""Two fingers drive a figure's legs: what plants its feet, the script of walking fingers, and the picture."""
