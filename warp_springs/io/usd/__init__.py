"""Animations in OpenUSD."""
