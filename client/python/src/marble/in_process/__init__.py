"""The calls of a client that has no server: core's solver in the callers' own threads."""
