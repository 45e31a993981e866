"""Which physical effect is missing: ranked evidence on held-out takes, beside a control."""
