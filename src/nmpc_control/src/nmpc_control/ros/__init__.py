"""Messages to core types and back, and the nodes."""
