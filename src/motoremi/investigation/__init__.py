"""The next measurement: how further data change the probabilities of the explanations, and which measurement gives most information."""
