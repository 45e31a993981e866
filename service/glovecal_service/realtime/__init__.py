"""The real-time process: router and prediction. It waits for no other."""
