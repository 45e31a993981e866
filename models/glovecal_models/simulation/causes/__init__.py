"""Physical causes that can be hidden in a simulated session, one file each, several forms of every one."""
