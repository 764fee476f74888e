"""The next measurement: what conditions and values do to the explanations that stand, and which one would tell most."""
