"""Between robots and kernels: how robots are packed, cut into slices, and stepped by a layout."""
