"""The HTML page of the paper's experiments: figures, tables, text."""
