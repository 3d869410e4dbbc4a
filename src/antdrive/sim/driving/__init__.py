"""The drive loop and its parts: localisation, guidance, control rules, replanning and exploration."""
