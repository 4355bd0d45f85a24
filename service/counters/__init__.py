"""Step counters: one file an algorithm, one contract for all, one registry that names them."""
