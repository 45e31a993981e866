"""What results of the models look like as JSON: the schemas of REST, of stored jobs and of ``--json``."""
