"""Another language understands the telemetry: runs the Python of docs/TELEMETRY.md on the stored datagram.

python_test.py PROJECT_SOURCE_DIR FOLDER_OF_stereotrack_pb2
"""
import math
import pathlib
import re
import socket
import struct
import sys
import tempfile
import threading
import time

source = pathlib.Path(sys.argv[1])
sys.path.insert(0, sys.argv[2])

page = (source / "docs/TELEMETRY.md").read_text(encoding="utf-8")
blocks = re.findall(r"```python\n(.*?)```", page, re.S)
assert len(blocks) == 1, "docs/TELEMETRY.md has one Python example"
example = {"__name__": "example"}
exec(compile(blocks[0], "docs/TELEMETRY.md", "exec"), example)

lines = (source / "tests/unit/telemetry/datagrams_v1.hex").read_text(encoding="ascii").splitlines()
stored = bytes.fromhex(next(line for line in lines if line and not line.startswith("#")))


def check(d):
    assert (d.rig, d.session, d.sequence, d.part, d.parts, d.ordinal) == (9, 0x0123456789ABCDEF, 1, 1, 1, 42), d
    assert (d.capture_time_ns, d.send_time_ns) == (1700000000123456789, 1700000000173456789), d
    assert (d.latency_ns, d.flags, d.frames_skipped, d.tracks_dropped, d.unit_m) == (50_000_000, 18, 3, 2, 0.5), d
    near, flat = d.targets
    assert (near.id, near.state, near.measured, near.distance) == (7, 2, True, 13), near
    assert list(near.position) == [3, 4, 12] and list(near.velocity) == [0.5, -0.25, 2], near
    assert list(near.box) == [100, 50, 40, 80] and math.isclose(near.extent[0], 1.2, rel_tol=1e-6), near
    P = example["covariance"](near)
    assert P[0][0] == 4 and P[0][2] == P[2][0] == 3 and abs(P[2][2] - 9) < 9 / 128 and P[5][5] == 1, P
    assert (flat.id, flat.state, list(flat.position)) == (300, 3, []), flat
    assert example["covariance"](flat) is None


check(example["decode"](stored))
assert example["decode"](stored[:-5]) is None, "cut inside the last field, unit_m"
assert example["decode"](stored[:-6]) is None, "cut between two fields: valid protobuf, only `size` tells"

lines = (source / "tests/unit/telemetry/datagrams_live_v1.hex").read_text(encoding="ascii").splitlines()
live, status, signed = (bytes.fromhex(line) for line in lines if line and not line.startswith("#"))
keys = {3: bytes(range(32)), 4: bytes(32)}
verify = example["verify"]

d = example["decode"](live)
assert d.flags == 18 | 64 | 128 | 256 | 512 and not d.HasField("status"), d
assert (d.live.tai_offset_ns, d.live.tai_error_ns, d.live.pair_skew_ns) == (1700000037000000001, 1500, -12000), d
assert (d.live.exposure_left_us, d.live.exposure_right_us, d.live.send_error_ns) == (8000, 8100, 35000), d
assert (d.live.efforts_shed, d.live.health) == (10, 136), d
d = example["decode"](status)
assert d.HasField("status") and d.sequence == 0 and d.status.sequence == 1 and not d.targets, d
assert (d.status.uptime_ms, d.status.outputs_on_time, d.status.skew_max_us) == (86400000, 5000000000, 40), d
assert not d.live.HasField("pair_skew_ns") and d.live.HasField("send_error_ns"), d
d = example["decode"](signed)
assert d.key_id == 3 and len(d.hash) == 16 and d.size == len(live) == len(signed) - 25, d

assert verify(signed, keys)
assert not verify(live, keys) and not verify(b"", keys), "not signed"
assert not verify(signed, {4: keys[4]}) and not verify(signed, {3: keys[4]}), "another key"
for i in range(8 * len(signed)):
    altered = bytearray(signed)
    altered[i // 8] ^= 1 << i % 8
    assert not verify(bytes(altered), keys), f"bit {i}"
assert not any(verify(signed[:n], keys) for n in range(len(signed)))
assert not verify(signed + b"\0", keys)

fresh = example["Fresh"]()
stream = [example["decode"](live) for _ in range(6)]
for n, d in enumerate(stream):
    d.sequence += n
assert all(fresh(stream[n]) for n in (0, 3, 2, 5, 1, 4)) and not any(fresh(d) for d in stream)
assert fresh(example["decode"](status)) and not fresh(example["decode"](status))
stream[0].session += 1
assert fresh(stream[0]) and not fresh(stream[0])
d = example["decode"](status)
d.status.sequence = 9
assert not fresh(d), "a session under that of the messages"

with tempfile.NamedTemporaryFile("w", suffix=".key") as file:
    file.write("# comment\n\n3 " + keys[3].hex() + "\n")
    file.flush()
    assert example["load_keys"](file.name) == {3: keys[3]}

with tempfile.NamedTemporaryFile() as file:
    file.write((struct.pack("<I", len(stored)) + stored) * 2)
    file.flush()
    both = list(example["read"](file.name))
    assert len(both) == 2
    check(both[1])

with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
    probe.bind(("127.0.0.1", 0))
    port = probe.getsockname()[1]


def send():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        while not received.is_set():
            s.sendto(stored, ("127.0.0.1", port))
            time.sleep(0.01)


received = threading.Event()
threading.Thread(target=send, daemon=True).start()
check(next(example["listen"](port=port)))
received.set()
print("ok")
