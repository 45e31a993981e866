"""Motion that another program recorded (TRC, BVH), read as reference angles of a hand."""
