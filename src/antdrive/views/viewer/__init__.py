"""Self-contained pages of drives, `drive.html`: their content, and the viewer's modules in `assets`."""
