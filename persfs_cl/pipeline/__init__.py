"""From a photograph's file to its surface, and to a folder of results."""
