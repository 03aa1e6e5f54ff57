"""Random files and random calls, from seeds: ``python -m fuzz`` in tests/ runs them for as long as one likes."""
