"""Views of a result: pictures by an own rasteriser, and the appearance that all views share."""
