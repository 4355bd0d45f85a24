"""The pipeline: sessions of all devices, the supervisor that keeps them connected, the hub that tells of them."""
