"""sensor_fault: a wire or plug fails; found in takes, watched for live."""
