"""Gloves that send by themselves: links, lines, options, and the device around a parser."""
