"""A coarse depth from elsewhere, and what it and the shading say of each other (section 7 of the method)."""
