"""The paper's experiments done again: its tables, its figures, and the method that it compares with."""
