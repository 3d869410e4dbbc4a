"""World files: read, checked and written whole."""
