"""Forms that were set aside once and have been read since: open ones, but never drawn by a seed."""
