"""Files as the devices write them, by their makers' public descriptions: no real one is kept in the project.

CWA: openmovement, Docs/ax3/ax3-technical.md (a header «MD» of 1024 bytes, blocks «AX» of 512, little-endian, the words
of a block sum to 0). GT3X: github.com/actigraph/GT3X-File-Format (README, info.txt, PARAMETERS 21,
ACTIVITY 0, ACTIVITY2 26); ACTIVITY3 27 is known from github.com/actigraph/pygt3x.
"""

import io
import math
import struct
import zipfile
from datetime import UTC, datetime, timedelta
from functools import reduce
from operator import xor

import numpy as np

START = datetime(2022, 12, 9, 10, 30, tzinfo=UTC)
CWA_RATE_CODES = {12.5: 7, 25: 8, 50: 9, 100: 10}
"""Rate is 3200 / 2^(15 - code); the range ±8 g is 1 in the two highest bits."""


def packed_time(at):
    return (at.year - 2000) << 26 | at.month << 22 | at.day << 17 | at.hour << 12 | at.minute << 6 | at.second


def cwa(acc_g, *, rate_hz=100, gyro_dps=None, stamps_s=None, annotation=""):
    """Return a file of whole blocks; `stamps_s` are the blocks' times after START, by default those of the rate."""
    per_block = 80 if gyro_dps is None else 40
    code = CWA_RATE_CODES[rate_hz] | 1 << 6
    counts = np.round(np.asarray(acc_g) * 256)
    if gyro_dps is not None:
        counts = np.hstack([np.round(np.asarray(gyro_dps) * 32768 / 2000), counts])
    blocks = [counts[at : at + per_block] for at in range(0, len(counts), per_block)]
    if stamps_s is None:
        stamps_s = [at * per_block / rate_hz for at in range(len(blocks))]
    return cwa_header(code, annotation, gyro_dps is not None) + b"".join(
        cwa_block(number, block, at_s, code, rate_hz)
        for number, (block, at_s) in enumerate(zip(blocks, stamps_s, strict=True))
    )


def cwa_header(code, annotation, is_ax6):
    head = struct.pack("<2sHBHIHIII", b"MD", 1020, 0x64 if is_ax6 else 0x17, 1234, 7, 0, 0, 0, 0)
    head = head.ljust(36, b"\xff") + bytes([code]) + struct.pack("<IBh", 0, 44, -1)
    return head.ljust(64, b"\xff") + annotation.encode().ljust(448, b" ") + b"\xff" * 512


def cwa_block(number, counts, at_s, code, rate_hz):
    at = START + timedelta(seconds=math.floor(at_s))
    fraction = int((at_s % 1) * 32768)
    # Firmware puts the fraction's samples into the offset too, for software that knows no fraction.
    offset = -((fraction * 2 * int(rate_hz)) >> 16)
    gyro_2000_dps = 2 << 10 if counts.shape[1] == 6 else 0
    head = struct.pack("<2sHHIIIHHBBBBhH", b"AX", 508, 0x8000 | fraction, 7, number, packed_time(at), gyro_2000_dps,
                       256, 0, 200, code, counts.shape[1] << 4 | 2, offset, len(counts))  # fmt: skip
    body = (head + counts.astype("<i2").tobytes()).ljust(510, b"\0")
    total = sum(struct.unpack("<255H", body)) & 0xFFFF
    return body + struct.pack("<H", -total & 0xFFFF)


def gt3x(acc_g, *, rate_hz=30, missing_s=(), activity2=(), kind=26, subject="P7"):
    """Return a zip with one record a second of `acc_g`; the seconds in `missing_s` are left out, as sleep mode does.

    Those in `activity2` are records of ActiGraph's newer `kind`.
    """
    start = int(START.timestamp())
    # The rate in parameter space 1, number 10; the scale in space 0, number 55, as 0.5 × 2⁹ = 256 counts per g.
    log = record(21, start, struct.pack("<HHIHHI", 1, 10, rate_hz, 0, 55, 0x09400000))
    counts = np.round(np.asarray(acc_g) * 256).astype(int)
    for second in range(len(counts) // rate_hz):
        rows = counts[second * rate_hz : (second + 1) * rate_hz]
        if second in missing_s:
            continue
        log += record(kind, start + second, rows.astype("<i2").tobytes()) if second in activity2 else record(
            0, start + second, twelve_bits(rows[:, [1, 0, 2]]))  # fmt: skip
    log += record(0, start + len(counts) // rate_hz, b"\x01")  # the dock's USB event, no sample
    info = f"Serial Number: MOS2E00000000\nSample Rate: {rate_hz}\nStart Date: 638061246000000000\nStop Date: 0\n"
    info += f"Acceleration Scale: 256.0\nSide: Left\nLimb: Wrist\nSubject Name: {subject}\n"
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("info.txt", info)
        archive.writestr("log.bin", log)
    return file.getvalue()


def record(kind, at_s, payload):
    body = struct.pack("<BBIH", 0x1E, kind, at_s, len(payload)) + payload
    return body + bytes([~reduce(xor, body) & 0xFF])


def twelve_bits(rows):
    text = "".join(f"{value & 0xFFF:03x}" for value in rows.ravel().tolist())
    return bytes.fromhex(text + "0" * (len(text) % 2))
