"""Runs of a procedure: step by step, resumed, rehearsed, replayed from recorded traffic, or one measurement at a time."""
