"""Pictures and films, drawn by the kernels of this package without a GPU."""
