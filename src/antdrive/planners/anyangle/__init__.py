"""Any-angle planners."""
