"""Recordings as files that people train on: one module a format, none of which knows another."""
