"""The store: devices, sessions, raw samples, steps and snapshots in one SQLite file, by one writing thread."""
