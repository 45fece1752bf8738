"""Rays aimed where accelerators fail, and the comparison of every tree with brute force."""
