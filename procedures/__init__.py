"""Bench procedures as data (TOML)."""
