"""Batches, jobs and sessions: what they know, and their calls for threads."""
