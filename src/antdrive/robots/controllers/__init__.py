"""Built-in controllers besides `PurePursuit`, and the registry of controllers."""
