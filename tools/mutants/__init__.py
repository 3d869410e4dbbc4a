"""Mutation testing: small faults put into copies of the code, each of which a test should notice."""
