"""Inspection of what a fitted model leaves unexplained.

Where the model fails, the best error that any linear circuit can reach, the value that an element would need, and whether both sweeps agree.
"""
