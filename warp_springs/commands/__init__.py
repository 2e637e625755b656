"""The commands of ``warp-springs``: each a module with what it does and its own help."""
