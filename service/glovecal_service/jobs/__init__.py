"""Runs queued jobs in worker processes; the database is the only memory."""
