"""World files: reading, checking and writing them."""
