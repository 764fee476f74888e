"""Thousands of sessions: the same fit and diagnosis for each, on local processes or a cluster, and what they say together."""
