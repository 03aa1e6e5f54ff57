"""Files: read whole and written whole, photographs, masks, depth maps and points."""
