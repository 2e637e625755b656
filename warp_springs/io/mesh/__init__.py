"""Meshes in any format that meshio knows, in and out."""
