"""From linear light to the image that is solved."""
