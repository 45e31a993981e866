"""What can be asked of takes and models: one file a question; routes, jobs and verbs follow from it."""
