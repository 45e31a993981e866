"""Live bridges: poses of gloves, sent on as they come to tools that do not speak zenoh."""
