"""The studio: pages on which a hand is seen, captured, compared, and its missing effect found and added.

Part of the web process. Pages ask the service what REST answers, through its own routes, and compute nothing:
a page never knows what a script could not find out. Live poses reach a page as one small array a frame.
"""
