"""Streaming signal processing: device time, the 50 Hz grid, compiled kernels. Pure: no I/O, no clocks."""
