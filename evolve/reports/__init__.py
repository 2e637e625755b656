"""What a person gets of a run: plots, tables, films, animations, and the page with all of them."""
