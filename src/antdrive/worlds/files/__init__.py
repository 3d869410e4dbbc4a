"""World files."""
