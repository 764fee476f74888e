"""The search over sets of effects, the decision from their probabilities, and the verdict."""
