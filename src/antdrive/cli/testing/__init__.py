"""Where installations made before the pytest plugin moved look for it; it leaves once they are made anew."""
