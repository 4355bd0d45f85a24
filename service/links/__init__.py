"""Links: how a device's bytes arrive. One object is one connection, never used again."""
