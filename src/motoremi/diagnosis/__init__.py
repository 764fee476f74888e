"""The search over sets of effects, what it lets one believe, and the verdict."""
