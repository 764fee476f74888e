"""Runs of a procedure: step by step, resumed, rehearsed, replayed from recorded traffic, or as single measurements on request."""
