# SPDX-License-Identifier: BSD-3-Clause
"""Other readers and a sender of Doppler logs.

read FILE [FRAME]   what dolfyn reads of a file of PD0, one line an ensemble; velocities turned by
                    dolfyn to FRAME (inst, earth) where it is given
stream FORMAT RATE  a TCP server that sends RATE ensembles a second in pd0 or pd6; the ranges of the
                    beams carry the time of sending: beam 1 in units of 0.1 ms, modulo 2^24
"""
import datetime
import socket
import struct
import sys
import time


def read(path, frame=None):
    import warnings
    warnings.simplefilter("ignore")
    import dolfyn
    ds = dolfyn.io.rdi.read_rdi(path)
    if frame:
        dolfyn.rotate2(ds, frame, inplace=True)
    print("begin", ds.attrs["coord_sys"], ds.attrs["beam_angle"], ds.attrs["beam_pattern"],
          ds.attrs["orientation"], ds.attrs["use_pitchroll"])
    epoch = ds["time"].values.astype("datetime64[ns]").astype("int64") * 1e-9
    for i in range(ds.sizes["time"]):
        v = [int(ds["number"].values[i]), epoch[i] - 946684800]
        v += [float(ds[n].values[i]) for n in
              ("heading", "pitch", "roll", "c_sound", "depth", "salinity", "temp")]
        v += [float(x) for x in ds["dist_bt"].values[:, i]]
        v += [float(x) for x in ds["vel_bt"].values[:, i]]
        print(*("%.13g" % x for x in v))
    print("done", flush=True)


def sealed(types):
    """Header, types, sum."""
    offset = 6 + 2 * len(types)
    header = b"\x7f\x7f" + struct.pack("<HBB", offset + sum(map(len, types)), 0, len(types))
    for t in types:
        header += struct.pack("<H", offset)
        offset += len(t)
    body = header + b"".join(types)
    return body + struct.pack("<H", sum(body) & 0xffff)


def pd0(number, now, clock):
    fixed = bytearray(59)
    fixed[2:6] = 51, 40, 0x4b, 0x42
    fixed[8], fixed[9], fixed[25], fixed[58] = 4, 1, 1 << 3, 30
    variable = bytearray(65)
    struct.pack_into("<HH7BB", variable, 0, 0x0080, number & 0xffff, *clock, number >> 16)
    struct.pack_into("<HHHhhhh", variable, 14, 1500, 0, 9000, 100, -100, 35, 1500)
    units = int(now * 1e4) % 2**24
    ranges = [units, 1000, 1000, 1000]
    track = bytearray(85)
    struct.pack_into("<H", track, 0, 0x0600)
    struct.pack_into("<4H4h", track, 16, *(r & 0xffff for r in ranges), 100, -200, 10, 1)
    struct.pack_into("<4h", track, 50, *[-32768] * 4)
    track[77:81] = (r >> 16 for r in ranges)
    return sealed([bytes(fixed), bytes(variable), bytes(track)])


def pd6(number, now, clock):
    units = int(now * 1e4) % 2**24
    return ("".join((
        ":SA, +1.00, -1.00, 90.00\r\n",
        ":TS,%02d%02d%02d%02d%02d%02d%02d,35.0,+15.0,   0.0,1500.0,  0\r\n" % clock,
        ":RA,   0.00,%.2f,  71.32,  71.32,  71.31\r\n" % (units * 0.01),
        ":WI,-32768,-32768,-32768,-32768,V\r\n:WS,-32768,-32768,-32768,V\r\n",
        ":WE,-32768,-32768,-32768,V\r\n:WD,+0.00,+0.00,+0.00,20.00,0.00\r\n",
        ":BI,  -100,  +200,   -10,    +1,A\r\n:BS,   +71,  +212,   -10,A\r\n",
        ":BE,  +212,   -71,   -10,A\r\n:BD,+0.00,+0.00,+0.00,  10.00,  0.05\r\n"))).encode()


def stream(form, rate):
    server = socket.create_server(("127.0.0.1", 0))
    print("port", server.getsockname()[1], "port", flush=True)
    link, _ = server.accept()
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    begun, k = time.monotonic(), 0
    start = datetime.datetime.now(datetime.timezone.utc)
    while True:
        time.sleep(max(0, begun + k / rate - time.monotonic()))
        k += 1
        t = start + datetime.timedelta(seconds=k / rate)
        clock = (t.year % 100, t.month, t.day, t.hour, t.minute, t.second, t.microsecond // 10000)
        link.sendall((pd0 if form == "pd0" else pd6)(k, time.monotonic(), clock))


if __name__ == "__main__":
    if sys.argv[1] == "read":
        read(*sys.argv[2:])
    else:
        stream(sys.argv[2], float(sys.argv[3]))
