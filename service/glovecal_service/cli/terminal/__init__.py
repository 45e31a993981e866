"""What every verb does in a terminal: reach the service, print, wait, refuse, write files."""
