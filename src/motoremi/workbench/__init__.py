"""The local web page: measure, fit, compare, diagnose, add effects and write reports in a browser."""
