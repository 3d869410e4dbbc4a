"""Former name of the pytest plugin, which earlier installations load; it leaves once they are renewed."""
