"""Planning while the world changes: replanners answer again after an edit, and agents decide cell by cell."""
