"""Wearables: one file a device family, sans-I/O, decoder and encoder together."""
