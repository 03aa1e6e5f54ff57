"""Tests of the command. A package, so that its modules may have names that others have too."""
