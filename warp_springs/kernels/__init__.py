"""Warp kernels: the only folder that contains any.

``law`` states the physics, each formula once; ``lanes`` is the layout for the CPU.
"""
