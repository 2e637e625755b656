"""warp_springs beside every alternative; the command is ``run.py``."""
