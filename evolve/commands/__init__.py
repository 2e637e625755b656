"""The commands of ``evolve``: each a class whose docstring is its help."""
