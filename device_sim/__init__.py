"""A bracelet that exists only in software: gait, sensor, GATT server and the radio between it and a host."""
