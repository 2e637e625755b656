"""Pages of HTML: robots in motion, documents, and what is served while a run lasts."""
