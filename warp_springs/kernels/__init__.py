"""Warp kernels: the only folder that contains any.

``law`` states the physics, each formula once, for any number type; ``dialect`` is that type on a
CPU. ``bundle`` is what robots of one topology share, ``lanes`` and ``strands`` step them,
``buffers`` declares their memory. ``raster`` and ``shading`` draw pictures.
"""
