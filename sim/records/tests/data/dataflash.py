"""Writes bench.bin and chirp.bin, DataFlash logs as ArduPilot writes them, with pymavlink, and reads them back with it into
dataflash.csv: every 50th message of those that an import takes, and the sum of each field over all of them.

    pip install pymavlink==2.4.50
    python3 dataflash.py

The formats are those of ArduPilot's LogStructure.h and, for ECRP, of its applet actuator_chirp.lua.
"""

import math
import random

from pymavlink.DFReader import DFFormat, DFMessage, DFReader_binary

FORMATS = [
    (128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
    (64, "PARM", "QNff", "TimeUS,Name,Value,Default"),
    (65, "MSG", "QZ", "TimeUS,Message"),
    (66, "RCOU", "QHHHHHHHHHHHHHH", "TimeUS," + ",".join(f"C{n}" for n in range(1, 15))),
    (67, "ESC", "QBffffcfcf", "TimeUS,Instance,RPM,RawRPM,Volt,Curr,Temp,CTot,MotTemp,Err"),
    (240, "ECRP", "Qfff", "TimeUS,PWM,Freq,RPM"),
]


class Writer:
    def __init__(self, name):
        self.file = open(name, "wb")
        self.formats = {}
        for kind, name, fields, columns in FORMATS:
            empty = DFFormat(kind, name, 0, fields, columns)
            length = 3 + sum({"B": 1, "H": 2, "c": 2, "f": 4, "n": 4, "Q": 8, "N": 16, "Z": 64}[c] for c in fields)
            self.formats[name] = empty
            self.write("FMT", kind, length, name, fields, columns)

    def write(self, name, *values):
        values = [v.encode() if isinstance(v, str) else v for v in values]
        message = DFMessage(self.formats[name], values, False, None)
        packed = message.get_msgbuf()
        assert packed is not None, (name, values)
        self.file.write(packed)

    def parameters(self, **values):
        for name, value in values.items():
            self.write("PARM", 900_000, name, float(value), 0.0)


def bench():
    """Motor 1, at output 3, runs a staircase; its ESC reports every 10 ms, those of the others every 100 ms."""
    log = Writer("bench.bin")
    log.parameters(MOT_PWM_MIN=1100, MOT_PWM_MAX=1900, SERVO3_FUNCTION=33, SERVO1_FUNCTION=34, SERVO2_FUNCTION=35,
                   SERVO4_FUNCTION=36, SERVO9_FUNCTION=0)
    log.write("MSG", 950_000, "motor test")
    levels = [1300, 1500, 1700, 1460, 1620, 1380]
    lag_s, delay_s, time_us, speed = 0.06, 0.015, 1_000_000, 0.0
    rng = random.Random(1)
    while time_us < 10_000_000:
        seconds = (time_us - 1_000_000) * 1e-6
        level = lambda s: 1100 if s < 0 else levels[min(int(s / 1.5), 5)]
        if time_us % 20_000 == 0:
            outputs = [1100, 1100, level(seconds), 1100] + [0] * 10
            log.write("RCOU", time_us + 137, *outputs)
        now = 12_000 * math.sqrt((level(seconds - delay_s) - 1100) / 800)
        speed += (now - speed) * (1 - math.exp(-0.001 / lag_s))
        if time_us % 10_000 == 0:
            seen = round(speed + rng.gauss(0, 8))
            log.write("ESC", time_us + 400, 2, seen * 1.01, float(seen), 16.0 - seen / 50_000, seen / 3000, 32.0, 1.5, 0.0, 0.0)
        if time_us % 100_000 == 0:
            for instance in (0, 1, 3):
                log.write("ESC", time_us + 500, instance, 0.0, 0.0, 16.0, 0.0, 25.0, 0.0, 0.0, 0.0)
        time_us += 1000
    log.file.close()


def chirp():
    """Two sweeps of the applet: a short one that was stopped, and one from 0.5 to 15 Hz in 24 s. A row every 5 ms and what the
    script itself took. The speed is a lag of 80 ms behind 1300..1600 us, seen 30 ms late."""
    log = Writer("chirp.bin")
    log.parameters(MOT_PWM_MIN=1000, MOT_PWM_MAX=2000)
    rng = random.Random(2)
    lag_s, age_s = 0.08, 0.03
    for begins_us, lasts_s in ((2_000_000, 4.0), (9_000_000, 24.0)):
        low, high, dwell, whole = 0.5, 15.0, 4.0, 24.0
        rate = math.log(high / low)
        time_us, pulse, before_us, speed = begins_us, 0, begins_us, 0.0
        history = [(begins_us - 100_000, 0.0)]
        while time_us < begins_us + lasts_s * 1e6:
            # Between rows the pulse is held.
            drive = max(pulse - 1000, 0) * 14.0
            steps = max(1, (time_us - before_us) // 500)
            for k in range(steps):
                speed += (drive - speed) * (1 - math.exp(-(time_us - before_us) * 1e-6 / steps / lag_s))
                history.append((before_us + (k + 1) * (time_us - before_us) / steps, speed))
            seconds = (time_us - begins_us) * 1e-6
            along = max(seconds - dwell, 0.0) / (whole - dwell)
            frequency = low * math.exp(rate * along)
            if seconds <= dwell:
                phase = 2 * math.pi * low * (seconds - dwell)
            else:
                phase = 2 * math.pi * low * (whole - dwell) / rate * (math.exp(rate * along) - 1)
            fade = min(1.0, 0.5 - 0.5 * math.cos(math.pi * seconds / 5.0)) if seconds < 5.0 else 1.0
            if seconds > whole - 1.0:
                fade = 0.5 + 0.5 * math.cos(math.pi * (seconds - whole + 1.0))
            at = time_us - age_s * 1e6
            while len(history) > 2 and history[1][0] <= at:
                history.pop(0)
            (one_us, one), (two_us, two) = history[0], history[min(1, len(history) - 1)]
            seen = one if at <= one_us or two_us == one_us else one + (two - one) * (at - one_us) / (two_us - one_us)
            pulse = math.floor(1450 + 150 * fade * math.sin(phase))
            seen = max(0.0, seen + rng.gauss(0, 20)) if seconds > 0.03 else -1.0
            log.write("ECRP", time_us, float(pulse), frequency, seen)
            before_us = time_us
            time_us += 5000 + int(rng.expovariate(1 / 600)) % 3000
    log.file.close()


def read_back():
    lines = ["file,message,number,field,value"]
    for name, wanted in (("bench.bin", ("RCOU", "ESC")), ("chirp.bin", ("ECRP",))):
        reader = DFReader_binary(name)
        counts, sums = {}, {}
        while (message := reader.recv_match(type=list(wanted))) is not None:
            kind = message.get_type()
            number = counts[kind] = counts.get(kind, 0) + 1
            for field in message.get_fieldnames():
                value = getattr(message, field)
                sums[kind, field] = sums.get((kind, field), 0.0) + value
                if number % 50 == 1:
                    lines.append(f"{name},{kind},{number},{field},{value!r}")
        for (kind, field), value in sums.items():
            lines.append(f"{name},{kind},{counts[kind]},sum of {field},{value!r}")
    with open("dataflash.csv", "w") as file:
        file.write("\n".join(lines) + "\n")


bench()
chirp()
read_back()
