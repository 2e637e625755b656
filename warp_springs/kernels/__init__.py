"""Warp kernels: the only folder that contains any.

``law`` states the physics, each formula once, for any number type; ``dialect`` is that type on a
CPU, ``features`` what of it is compiled in, ``buffers`` the memory. ``bundle`` is what robots of
one topology share; ``lanes`` and ``strands`` step them, by the ``steps`` of every fused layout.
In a crowd each mass gathers its own springs (``gather``): ``block``, ``flat_threads``,
``flat_launches``. ``raster`` and ``shading`` draw pictures.
"""
