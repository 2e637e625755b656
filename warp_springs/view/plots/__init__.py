"""Plots of a run. Each function draws into the axes it is given and returns them.

All of them are safe for the colour-blind (the palette of Okabe and Ito; red and blue for tension
and compression), name their units, and look right alone, side by side or in print.
"""

from warp_springs.view.plots.contact import footfall
from warp_springs.view.plots.energy import energies, residual
from warp_springs.view.plots.motion import height, speed, trajectory
from warp_springs.view.plots.stress import stress_histogram
from warp_springs.view.plots.style import figure, overview

__all__ = [
    "energies",
    "figure",
    "footfall",
    "height",
    "overview",
    "residual",
    "speed",
    "stress_histogram",
    "trajectory",
]
