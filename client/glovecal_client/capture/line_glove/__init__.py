"""Any glove that sends lines of text, described by a TOML file alone."""
