"""The real-time half of the service: router, prediction, recorder. It never waits for the other half."""
