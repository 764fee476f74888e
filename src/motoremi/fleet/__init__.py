"""Fit and diagnosis of thousands of sessions, on local processes or a cluster, and statistics over all of them."""
