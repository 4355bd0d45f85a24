"""How well and how fast the counters count: on recordings with known steps, and against the papers' own figures."""
