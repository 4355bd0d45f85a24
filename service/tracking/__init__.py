"""Tracking: packets in, events out, nothing else."""
