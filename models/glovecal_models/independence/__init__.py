"""The independence examination of Wang & Neff 2013, section 3.1: which sensors stretch which others."""
