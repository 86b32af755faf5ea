# SPDX-License-Identifier: BSD-3-Clause
"""pynmea2 and pymap3d as the other side of nmea.hpp and local_ned.hpp.

generate N        N random sentences of each type, each with what pynmea2 itself reads of it
parse FILE        what pynmea2 reads of the sentences of FILE
ned               random origins and places, and what pymap3d makes of them
stream RATE       a TCP server that sends RATE sentences a second; DPT carries the time of sending
"""
import datetime
import random
import socket
import sys
import time

import pynmea2


def read(line):
    """Type and values: degrees, m, knots, s."""
    m = pynmea2.parse(line, check=True)
    kind = m.sentence_type
    if kind == "GGA":
        v = [m.latitude, m.longitude, seconds(m.timestamp), m.gps_qual, int(m.num_sats),
             float(m.horizontal_dil), m.altitude, float(m.geo_sep)]
    elif kind == "RMC":
        epoch = (m.datestamp - datetime.date(1970, 1, 1)).days * 86400
        v = [m.latitude, m.longitude, seconds(m.timestamp), m.spd_over_grnd, m.true_course, epoch]
    elif kind == "GLL":
        v = [m.latitude, m.longitude, seconds(m.timestamp)]
    elif kind == "VTG":
        v = [float(m.true_track), float(m.spd_over_grnd_kts)]
    elif kind == "ZDA":
        v = [int(m.day), int(m.month), int(m.year), seconds(m.timestamp)]
    elif kind in ("HDT", "HDM"):
        v = [float(m.heading)]
    elif kind == "HDG":
        v = [float(m.heading), float(m.deviation) * (1 if m.dev_dir == "E" else -1),
             float(m.variation) * (1 if m.var_dir == "E" else -1)]
    elif kind == "DPT":
        v = [float(m.depth), float(m.offset)]
    else:
        v = [float(m.data[2])]
    return kind + "".join(" %.17g" % x for x in v)


def seconds(t):
    return t.hour * 3600 + t.minute * 60 + t.second + t.microsecond * 1e-6


def sentence(r, kind, k):
    """Random, of the shape that receivers send; times go on, so that each is a new fix."""
    t = 3600 + k
    utc = "%02d%02d%02d.%02d" % (t // 3600 % 24, t // 60 % 60, t % 60, r.randrange(100))
    lat = ("%02d%010.7f" % (r.randrange(90), r.random() * 59.999), r.choice("NS"))
    lon = ("%03d%010.7f" % (r.randrange(180), r.random() * 59.999), r.choice("EW"))
    heading = "%.2f" % (r.random() * 359.99)
    side = lambda: ("%.1f" % (r.random() * 30), r.choice("EW"))
    talker = r.choice(["GP", "GN", "GL", "II", "SD", "HE", "HC", "YX"])
    fields = {
        "GGA": (utc, *lat, *lon, str(r.randrange(1, 6)), "%02d" % r.randrange(4, 30),
                "%.1f" % (0.5 + 3 * r.random()), "%.2f" % (r.random() * 2000 - 100), "M",
                "%.1f" % (r.random() * 150 - 100), "M", "", ""),
        "RMC": (utc, "A", *lat, *lon, "%.2f" % (r.random() * 40), heading,
                "%02d%02d%02d" % (r.randrange(1, 29), r.randrange(1, 13), r.randrange(0, 60)),
                *side(), r.choice("ADRF")),
        "GLL": (*lat, *lon, utc, "A", r.choice("AD")),
        "VTG": (heading, "T", heading, "M", "%.2f" % (r.random() * 40), "N", "1.00", "K", "A"),
        "ZDA": (utc, "%02d" % r.randrange(1, 29), "%02d" % r.randrange(1, 13),
                "%04d" % r.randrange(1990, 2060), "00", "00"),
        "HDT": (heading, "T"),
        "HDM": (heading, "M"),
        "HDG": (heading, *side(), *side()),
        "DPT": ("%.2f" % (r.random() * 6000), "%.1f" % (r.random() * 10 - 5)),
    }
    depth = r.random() * 6000
    for name in ("DBT", "DBS", "DBK"):
        fields[name] = ("%.1f" % (depth / 0.3048), "f", "%.1f" % depth, "M", "%.1f" % (depth / 1.8288),
                        "F")
    return str(pynmea2.TalkerSentence(talker, kind, fields[kind]))


def generate(n):
    r = random.Random(1)
    for kind in ("GGA", "RMC", "GLL", "VTG", "ZDA", "HDT", "HDM", "HDG", "DPT", "DBT", "DBS"):
        for k in range(n):
            s = sentence(r, kind, k)
            print(s, read(s), sep="\t")
    print("done", flush=True)


def parse(path):
    for line in open(path, newline=""):
        print(read(line))
    print("done", flush=True)


def ned():
    import pymap3d
    r = random.Random(2)
    for _ in range(2000):
        origin = [r.uniform(-90, 90), r.uniform(-180, 180), r.uniform(-100, 3000)]
        far = 10 ** r.uniform(-6, 1)
        place = [max(-90, min(90, origin[0] + r.uniform(-far, far))), origin[1] + r.uniform(-far, far),
                 r.uniform(-6000, 3000)]
        out = pymap3d.geodetic2ned(*place, *origin, ell=pymap3d.Ellipsoid.from_name("wgs84"))
        print(*("%.17g" % x for x in (*origin, *place, *out)))
    print("done", flush=True)


def stream(rate):
    server = socket.create_server(("127.0.0.1", 0))
    print("port", server.getsockname()[1], "port", flush=True)
    link, _ = server.accept()
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    begun, k = time.monotonic(), 0
    while True:
        time.sleep(max(0, begun + k / rate - time.monotonic()))
        t = time.monotonic()
        second = 36000 + k // 100
        utc = "%02d%02d%02d.%02d" % (second // 3600 % 24, second // 60 % 60, second % 60, k % 100)
        lines = [pynmea2.DPT("SD", "DPT", ("%.5f" % (t % 10000), "0.0"))]
        if k % 2 == 0:
            lines.append(pynmea2.GGA("GP", "GGA", (utc, "4403.0000000", "N", "00948.0000000", "E",
                                                   "1", "08", "0.9", "0.0", "M", "0.0", "M", "", "")))
        else:
            lines.append(pynmea2.HDT("HE", "HDT", ("%.2f" % (k % 360), "T")))
        link.sendall("".join(str(line) + "\r\n" for line in lines).encode())
        k += 1


if __name__ == "__main__":
    command, *arguments = sys.argv[1:]
    if command == "generate":
        generate(int(arguments[0]))
    elif command == "parse":
        parse(arguments[0])
    elif command == "ned":
        ned()
    else:
        stream(float(arguments[0]))
