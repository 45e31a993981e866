"""Motion that another program recorded (TRC, BVH), and tables of angles: the reference of a take."""
