"""What belongs to no noun: guards, problem documents, health, metrics, and what endpoints share."""
