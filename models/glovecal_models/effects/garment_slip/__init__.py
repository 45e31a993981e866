"""garment_slip: the glove slips on the hand while it is worn."""
