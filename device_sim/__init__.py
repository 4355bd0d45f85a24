"""A bracelet that exists only in software: gait, sensor, GATT server and the radio between it and a host.

| module | holds |
| --- | --- |
| `gait`, `source` | what is measured: a synthetic walker, or a recording |
| `bracelet`, `ring`, `rated` | sensor, clocks, sample numbers, packets, the last ten minutes, another rate; pure |
| `control_point` | what a host asks for and is answered; pure |
| `battery`, `step_register`, `pace` | what else it tells: charge, its own steps, running speed and cadence; pure |
| `gatt`, `peripheral`, `gatt_table` | the bracelet on the air: pacing and faults; advertising, link; GATT table |
| `controller`, `air`, `air_tcp` | the virtual radio: in this process, or over loopback TCP |
| `central`, `bleak_backend` | the host's side, as classes that bleak takes as `backend=` |

In one process, nothing but the radio waves simulated:

    bracelet = Bracelet(source)
    async with LocalAir() as air, air.bracelet(bracelet) as gatt, air.central() as central:
        device = await BleakScanner.find_device_by_name("Steplink", backend=central.scanner)
        async with BleakClient(device, backend=central.client) as client: ...
        await gatt.drop_link()

In several: `async with hosted_air("127.0.0.1:7400") as air, air.bracelet(bracelet): ...` in one, and
`async with remote_central("127.0.0.1:7400") as central: ...` in another.
"""

import logging

# bumble warns of what is a fault simulated on purpose; it is heard where logging is set up, not on a bare terminal.
logging.getLogger("bumble").addHandler(logging.NullHandler())
