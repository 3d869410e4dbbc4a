"""Mutation testing of the project."""
