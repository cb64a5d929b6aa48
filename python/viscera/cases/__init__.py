"""Organs and scenes written as CASE.toml: what a file may hold, how it is read, how it is written."""
