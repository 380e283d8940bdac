"""A Pixsys DRR460-12A-CAN, written from its manual alone: a program that speaks lines of candump.

    drr460.py [--node ID] [--bench-socket PATH]

Frames come on standard input and go to standard output; the bench is served on a socket, a JSON
object a line. Clauses are those of the manual. What the manual leaves open is marked "open".
"""

import argparse
import json
import math
import os
import re
import select
import socket
import sys
import time

from node_drr460 import (Abort, BOOT, Entry, Node, OPERATIONAL, PRE, READ_ONLY, STATE, STOPPED,
                         VALUE)

STEP = 0.01  # how often the controller looks at its inputs, in seconds

# Parameters 3000h (11.3.2): sub-index, default, lowest, highest.
PARAMETERS = """
1 0 0 18|2 0 0 2|3 0 -32767 32767|4 10000 -32767 32767|5 10 1 150|6 0 0 1|7 0 -10000 10000
8 0 -1000 1000|9 0 0 3|10 1 1 50|16 0 0 5|17 0 0 2|18 0 0 1|19 2 -10000 10000|20 0 0 3|21 0 0 3
22 0 0 2|23 0 -3600 3600|24 60 1 300|25 0 0 2|31 0 0 4|32 300 0 10000|33 0 0 10000|34 0 0 20000
35 0 0 10000|36 0 0 10000|37 0 0 1|38 0 0 1|39 0 -10000 10000|40 15 1 300|41 0 0 2|42 100 100 500
43 0 -200 500|44 10 1 300|45 0 0 100|46 100 0 100|47 30 0 10000|48 50 0 10000|49 500 0 10000
50 400 0 10000|56 0 0 12|57 0 0 3|58 5 -10000 10000|59 0 0 3|60 0 0 4|61 0 0 2|62 0 -3600 3600
68 0 0 12|69 0 0 3|70 5 -10000 10000|71 0 0 3|72 0 0 4|73 0 0 2|74 0 -3600 9360|80 0 0 2
81 1000 1 10000|82 50 0 100|83 1000 -10000 10000|84 15 0 1440|90 0 0 2|91 50 1 200|92 0 0 2000
93 0 0 2000|94 60 0 3600|100 0 0 6|101 1 0 1|102 0 -32767 32767|103 10000 -32767 32767|104 0 0 3
105 0 0 4|111 247 1 254|112 2 0 6|113 0 0 5|114 0 0 100|115 0 0 6000|121 0 0 1|122 0 0 3|123 0 0 3
124 0 0 3|125 1 0 1|126 0 -32767 32767|127 10000 -32767 32767|128 0 -32767 32767|129 0 0 1
130 0 -32767 32767|131 0 0 1"""

# Sensors (11.3.2, parameter 1): the range in degrees Celsius. From 14 on they are linear.
RANGES = [(-260, 1360), (-40, 1760), (-40, 1760), (-200, 1200), (-260, 400), (-260, 980),
          (-260, 1280), (100, 1820), (-100, 600), (-60, 180), (-40, 125), (-50, 150), (-100, 600),
          (-100, 600)]
NTC, VOLT, MA20, MA4, MV60, POT = 10, 14, 15, 16, 17, 18

# Bits of 4007h (11.3.10) by the fault on the bench.
MEMORY_FAULTS = {"write": 2, "read": 3, "calibration-missing": 4, "calibrations": 16,
                 "calibration-constants": 17, "parameters": 18, "set-points": 19,
                 "service-data-a": 20, "service-data-b": 21, "service-data-c": 22}
COLD_JUNCTION, PROCESS, HARDWARE_ERROR = 0, 1, 6
SHORT, OPEN, PARTIAL, OVER = 7, 8, 9, 10

# Currents of the analogue output by the parameters of states, in mA.
STATE_CURRENTS = (0.0, 4.0, 20.0, 21.5)

STIMULI = {
    "power": ("on", {"on", "off"}), "input-temperature-1": ("process", (-400, 2500)),
    "input-voltage-1": (0.0, (-1000, 30000)), "input-current-1": (0.0, (-5000, 40000)),
    "input-potentiometer-1": (0.0, (0, 100)), "input-resistance-1": (10.0, (0, 1000)),
    "input-wiring-1": ("connected", {"connected", "broken", "shorted"}),
    "terminal-temperature": (25.0, (-60, 150)), "transformer-current-1": (0.0, (0, 60)),
    "dip-switch-1": (1, (0, 255)), "dip-switch-2": (7, (0, 15)), "key": (0, (0, 1)),
    "memory-fault": ("none", {"none", *MEMORY_FAULTS}), "machine-fault": (0, (0, 1)),
    "bus-fault": ("none", {"none", "receive-overflow", "transmit-overflow", "error-passive"}),
    "module-1": ("fitted", {"fitted", "other", "broken", "faulty"}),
}
OBSERVATIONS = ("digital-outputs-1", "output-current-1", "run-led", "output-led-1", "output-led-2")


def rounded(value):
    return math.floor(value + 0.5)


def clamp(value, low, high):
    return max(low, min(high, value))


class Dictionary(dict):
    """The objects, by index and sub-index."""

    def var(self, index, kind, access, default=0, **more):
        self[index, 0] = Entry(kind, access, default, **more)

    def many(self, index, count, kind, access, default=0, **more):
        self[index, 0] = Entry("u8", "ro", count)
        for sub in range(1, count + 1):
            self[index, sub] = Entry(kind, access, default, **more)


def at(offset):
    """A default that depends on the node id."""
    return lambda node: node + offset


def add_communication(od):
    """The objects of 11.2."""
    od.var(0x1000, "u32", "ro", 0x000E0191)
    od.var(0x1001, "u8", "ro", pdo="t")
    od.many(0x1003, 10, "u32", "ro")
    od[0x1003, 0] = Entry("u8", "rw", 0, stored=False)
    od.var(0x1005, "u32", "ro", 0x80)
    for index, kind in ((0x1006, "u32"), (0x100C, "u16"), (0x100D, "u8"), (0x1015, "u16"),
                        (0x1017, "u16")):
        od.var(index, kind, "rw")
    for index, text in ((0x1008, "M260"), (0x1009, "DRR460-12A HW 1.0"), (0x100A, "FW 1.02")):
        od.var(index, "str", "ro", text)
    od.var(0x100B, "u8", "ro", at(0))
    od.many(0x1010, 1, "u32", "rw", 1, stored=False)
    od.many(0x1011, 1, "u32", "rw", 1, stored=False)
    od.var(0x1014, "u32", "ro", at(0x80))
    od.many(0x1016, 4, "u32", "rw")
    od.many(0x1018, 4, "u32", "ro")
    # "PIX", 260 (11.2.17).
    for sub, value in ((1, 0x584950), (2, 260), (3, 0x10000), (4, 1)):
        od[0x1018, sub].default = value
    od.many(0x1029, 1, "u8", "rw", 0, low=0, high=2)
    for n in range(2):
        od.many(0x1400 + n, 2, "u8", "rw", 255)
        od[0x1400 + n, 1] = Entry("u32", "rw", at(0x200 + 0x100 * n))
    for n in range(4):
        od.many(0x1800 + n, 5, "u16", "rw")
        od[0x1800 + n, 1] = Entry("u32", "rw", at(0x180 + 0x100 * n))
        od[0x1800 + n, 2] = Entry("u8", "rw", 255)
        del od[0x1800 + n, 4]
    # 11.1.5; 1A00h names four objects and a number of 2.
    mappings = {0x1600: (5, 0x40000010, 0x40010010, 0x40020010, 0x400C0008, 0x400D0008),
                0x1601: (3, 0x40040010, 0x400E0008, 0x400F0008),
                0x1A00: (2, 0x64010110, 0x40080010, 0x40040010, 0x40060010),
                0x1A01: (0, 0x64010210, 0x64010310, 0x64010410, 0x64010510),
                0x1A02: (0,), 0x1A03: (0,)}
    for index, (count, *objects) in mappings.items():
        od.many(index, 8, "u32", "rw")
        od[index, 0] = Entry("u8", "rw", count)
        for sub, value in enumerate(objects, 1):
            od[index, sub].default = value


def add_controller(od):
    """The objects of 11.3, and 4011h of 7.11."""
    od.many(0x2000, 19, "i16", "rw")
    od[0x2000, 1] = Entry("i16", "ro", 6)
    od[0x2000, 2] = Entry("i16", "rw", 120, 10, 1000)
    od[0x2000, 3] = Entry("i16", "rw", 127, 0, 127)
    od.many(0x3000, 143, "i16", "rw")
    for words in re.split(r"[|\n]", PARAMETERS.strip()):
        sub, default, low, high = map(int, words.split())
        od[0x3000, sub] = Entry("i16", "rw", default, low, high)
    for index in (0x4000, 0x4001, 0x4002):
        od.var(index, "i16", "rw", low=-32767, high=32767, pdo="rt")
    for index, kind, high in ((0x4003, "u8", 1), (0x4004, "u16", 10000), (0x400C, "u8", 1),
                              (0x400D, "u8", 1), (0x400E, "u8", 5), (0x400F, "u8", 1)):
        od.var(index, kind, "rw", low=0, high=high, pdo="rt", stored=False)
    for index, kind in ((0x4005, "u16"), (0x4006, "i16"), (0x4007, "u32"), (0x4008, "i16"),
                        (0x4009, "u8")):
        od.var(index, kind, "ro", pdo="t")
    od.var(0x400A, "u8", "rw", high=1, stored=False)
    od.var(0x400B, "u8", "rw", high=3, stored=False)
    od.var(0x4010, "i16", "rw", low=-32767, high=32767, pdo="r", stored=False)
    od.many(0x4011, 4, "u8", "rw", high=1, stored=False)
    od[0x4011, 4].high = 2


def add_profile(od):
    """The objects of 11.4."""
    od.many(0x6200, 1, "u8", "rw", pdo="r", stored=False)
    od.many(0x6206, 1, "u8", "rw", 255)
    od.many(0x6207, 1, "u8", "rw")
    od.many(0x6401, 5, "i16", "ro", pdo="t")
    od.many(0x6411, 1, "i16", "rw", pdo="r", stored=False)
    od.many(0x6421, 5, "u8", "rw", 7, high=31)
    od.var(0x6423, "bool", "rw", high=1)
    for index in (0x6424, 0x6425):
        od.many(index, 5, "i16", "rw")
    for index in (0x6426, 0x6427, 0x6428):
        od.many(index, 5, "u16", "rw")
    od.many(0x6443, 1, "u8", "rw", 1, high=1)
    od.many(0x6444, 1, "i16", "rw")
    od.many(0x67FE, 1, "u8", "rw", 0, low=0, high=2)


class Alarm:
    """An alarm: its parameters begin at 56 or 68, its objects are 4001h and 400Ch, or the next."""

    def __init__(self, number):
        self.number, self.base = number, 56 + 12 * (number - 1)
        self.clear(False)

    def clear(self, latched):
        self.condition, self.active, self.latched = False, latched, latched
        self.since = None  # since when the condition differs from the alarm
        self.inhibited = True  # until the condition was absent once (footnote 2)


class Drr460(Node):
    def __init__(self, send, node=None):
        super().__init__(send)
        self.od = Dictionary()
        for add in (add_communication, add_controller, add_profile):
            add(self.od)
        self.bench = {name: first for name, (first, _) in STIMULI.items()}
        if node is not None:
            self.bench["dip-switch-1"] = node
        # What the memory keeps without 1010h.
        self.kept = {"running": True, "manual": False, "percent": 0, "latched": [False, False],
                     "command": False, "latch": None, "zero": None, "tuned": False}
        self.alarms = [Alarm(1), Alarm(2)]
        self.load_at = 25.0  # the temperature of the load
        self.plant, self.flags, self.loading = 25.0, 0, False
        self.current, self.q, self.stepped = 0.0, [False, False], 0.0
        self.memory_flags, self.pattern, self.pattern_at = 0, None, 0.0
        self.heats = False  # whether the command is on
        self.key_since = None
        self.fresh()

    def p(self, sub):
        return self.od[0x3000, sub].value

    # ---- Power, switches and resets ----

    def power_on(self):
        """The switches are read now (6.3). Contact 4 of the second one loads the defaults."""
        if self.bench["dip-switch-2"] & 8:
            self.saved, self.loading, self.state = None, True, None
            self.kept.update(running=True, manual=False, percent=0, latched=[False, False],
                             command=False, latch=None, zero=None, tuned=False)
            return
        self.load(0x3000, 0x3000)
        address = self.bench["dip-switch-1"] & 0x7F or self.p(111)
        if address > 127:
            # 111 may be 254, 127 is the last node id: no communication (open).
            self.state = None
            return
        self.node = address
        if (self.bench["dip-switch-2"] & 7 or self.p(112) + 1) != 7:
            self.state = None  # at another rate than the others on this bus, 1 Mbit/s
            return
        self.errors = {}
        self.reset(True)

    def power_off(self):
        self.state, self.loading = None, False
        self.boots_at, self.q, self.current, self.flags = None, [False, False], 0.0, 0

    def boot_time(self):
        return self.od[0x2000, 2].value / 100

    def state_after_boot(self):
        return self.od[0x2000, 3].value

    def application_reset(self):
        self.fresh()
        self.memory_flags = 0
        self.use_memory("read")
        start = self.p(17)
        running = self.kept["running"] if start == 2 else start == 0
        self.od[0x4003, 0].value = int(running)
        self.manual = self.p(25) == 2 and self.kept["manual"]
        self.od[0x400F, 0].value = int(self.manual)
        self.percent = self.kept["percent"] if self.manual else 0
        self.contact = self.p(22) == 2 and self.kept["command"]
        for alarm, latched in zip(self.alarms, self.kept["latched"]):
            alarm.clear(self.p(alarm.base + 5) == 2 and latched)
        # Once, at the next start (7.4).
        self.tune = 1 if self.p(31) == 3 and not self.kept["tuned"] else 0
        self.expand()
        if running:
            self.started()
        self.step()

    def booted(self):
        super().booted()
        # What is wrong with controller and board is still wrong after a start.
        if self.bench["module-1"] == "other":
            self.set_error("other", 0x5000, 0x81, b"\0\1\0\0\0")
        elif self.bench["module-1"] != "fitted":
            self.module_fault(self.bench["module-1"])
        if self.bench["bus-fault"] == "error-passive":
            self.bus_fault("error-passive")

    def fresh(self):
        """The controller without a past."""
        self.manual, self.percent, self.cold, self.contact = False, 0, 0.0, False
        self.integral, self.last_process, self.slope = 0.0, None, 0.0
        self.contact_since, self.cycle_at, self.cold_at = None, self.now, self.now
        self.position = 0.0  # of the valve, in percent
        self.soft_since, self.ramp = None, None
        self.tune, self.tune_data, self.tune_read = 0, None, self.now
        self.samples, self.process = [], 0
        self.broken = self.sensor_failed = False
        self.latch_since = None
        self.load_since = {}
        self.heard_at, self.offline = self.now, False
        self.error_mode = False
        for alarm in self.alarms:
            alarm.clear(False)

    def started(self):
        """STOP to START, or switched on in START: the soft start begins (7.9)."""
        self.soft_since = self.now if self.p(80) else None
        self.ramp = None
        for alarm in self.alarms:
            alarm.inhibited = True
        self.integral, self.cycle_at, self.cold_at = 0.0, self.now, self.now
        self.measure()
        self.tune_by_itself()

    def tune_by_itself(self):
        """Automatic tuning: at the start and when the set point moves (7.2; 31, 47)."""
        if self.p(31) == 1 and abs(self.od[0x4000, 0].value - self.process) > self.p(47):
            self.tune, self.tune_data = 1, None

    def expand(self):
        """The outputs of the expansion module at its start (11.3.2, 122 and 128)."""
        if self.p(121):
            self.od[0x6200, 1].value = self.p(122)
            self.od[0x6411, 1].value = self.p(128)

    # ---- Accesses ----

    def heard(self):
        self.heard_at, self.offline = self.now, False

    def store_fails(self):
        self.memory_flags &= ~(1 << MEMORY_FAULTS["write"])
        return self.use_memory("write")

    def read(self, index, sub):
        self.step()
        if index == 0x4004:
            return self.percent
        if index == 0x4005:
            return rounded(self.cold * 100)
        if index == 0x4006:
            # In tenths of a degree Celsius, whatever the unit of the process (open).
            return rounded(10 * self.bench["terminal-temperature"])
        if index == 0x4007:
            return self.flags
        if index == 0x4008:
            return self.setpoint()
        if index == 0x4009:
            return self.q[0] | self.q[1] << 1
        if index == 0x400A:
            return int(self.contact_can_be_reset())
        if index == 0x400B:
            return sum(a.number for a in self.alarms if a.latched and not a.condition)
        if index == 0x400E:
            self.tune_read = self.now
            if self.p(31) == 0:
                return self.od[0x400E, 0].value  # kept without effect (open)
            return 5 if self.p(31) == 4 and self.soft_since is not None else self.tune
        if index == 0x400F and self.p(25):
            return int(self.manual)
        if (index, sub) == (0x4011, 1):
            return int(self.latch_since is not None)
        if (index, sub) == (0x6401, 1):
            return self.process
        return super().read(index, sub)

    def refuse(self, index, sub, value):
        if (index, sub) == (0x2000, 3) and value not in (0, 4, 5, 127):
            raise Abort(VALUE)
        # 4004h outside manual mode and 400Fh with 0 in parameter 25 are taken without effect (open).
        if index == 0x400E:
            self.refuse_tune(value)
        if index == 0x4011 and value:
            self.refuse_latch(sub)

    def refuse_tune(self, value):
        kind = self.p(31)
        if kind in (1, 3):
            raise Abort(READ_ONLY)
        if value > {0: 3, 2: 1, 4: 3}[kind]:
            raise Abort(VALUE)
        if value and kind == 4 and self.soft_since is not None:
            raise Abort(STATE)

    def refuse_latch(self, sub):
        """The procedure is for linear inputs (7.11). A virtual zero moves at any time."""
        kind = self.p(9)
        free = sub == 1 or sub == 4 and kind >= 2 or self.latch_since is not None
        if self.p(1) < VOLT or kind == 0 or not free or sub == 4 and kind < 2:
            raise Abort(STATE)

    def written(self, index, sub, value, before):
        if index == 0x3000:
            self.parameter(sub, value)
        elif index == 0x4000 and value != before:
            if self.od[0x4003, 0].value:
                self.tune_by_itself()
        elif index == 0x4003:
            if value and not self.kept["running"]:
                self.started()
            self.kept["running"] = bool(value)
        elif index == 0x4004 and self.manual:
            self.percent = self.kept["percent"] = value
        elif index == 0x400A and value == 0 and self.contact_can_be_reset():
            self.contact = self.kept["command"] = False
        elif index == 0x400B:
            for alarm in self.alarms:
                if not value & alarm.number and alarm.latched and not alarm.condition:
                    alarm.latched = alarm.active = False
        elif index == 0x400E and self.p(31):
            self.tune, self.tune_data, self.tune_read = value, None, self.now
        elif index == 0x400F and self.p(25):
            self.switch_manual(bool(value))
        elif index == 0x4011:
            self.latch(sub, value)
            self.od[0x4011, sub].value = 0
        elif index == 0x1011:
            self.kept.update(running=True, manual=False, percent=0, latched=[False, False],
                             command=False, latch=None, zero=None, tuned=False)
        elif index in (0x6200, 0x6411):
            self.error_mode = False
        self.step()

    def switch_manual(self, manual):
        self.manual = self.kept["manual"] = manual
        self.od[0x400F, 0].value = int(manual)
        self.kept["percent"] = self.percent
        self.integral = self.percent / 100

    def parameter(self, sub, value):
        if sub == 41:
            # 7.8: the fluid chooses multiplier and cycle time.
            multiplier, cycle = ((100, 10), (125, 4), (250, 2))[value]
            self.od[0x3000, 42].value, self.od[0x3000, 44].value = multiplier, cycle
        elif sub == 25:
            asked = self.od[0x400F, 0].value
            self.switch_manual(bool(value and asked))
            self.od[0x400F, 0].value = asked
        elif sub == 31:
            self.od[0x400E, 0].value = 0
            self.tune, self.tune_data, self.kept["tuned"] = 0, None, False
        elif sub in (1, 2):
            self.samples = []
        elif sub == 9 and value == 0:
            self.latch_since, self.kept["latch"], self.kept["zero"] = None, None, None
        elif sub == 80 and value == 0:
            self.soft_since = None
        elif sub == 115:
            self.heard()
        for alarm in self.alarms:
            if sub == alarm.base:
                alarm.clear(False)

    def communication_error(self):
        if self.p(121):
            self.error_outputs()

    # ---- The input (11.3.2, 1 to 10) ----

    def in_degrees(self, celsius):
        """Tenths of the chosen degree."""
        unit = self.p(2)
        return rounded(10 * (celsius, celsius * 1.8 + 32, celsius + 273.15)[unit])

    def temperature(self):
        value = self.bench["input-temperature-1"]
        return self.plant if value == "process" else value

    def fraction(self):
        """The linear signal, from 0 at the start of its scale to 1 at the end; None: broken."""
        sensor, wiring = self.p(1), self.bench["input-wiring-1"]
        live = wiring == "connected"
        if sensor == POT:
            ohms = self.bench["input-potentiometer-1"] / 100 * self.bench["input-resistance-1"]
            return ohms / self.p(5) if live else None
        if sensor in (MA20, MA4):
            current = self.bench["input-current-1"] / 1000 if live else 0.0
            # A live zero shows a broken wire. Where it begins is open: 3.6 mA.
            if sensor == MA4:
                return None if current < 3.6 else (current - 4) / 16
            return current / 20
        millivolts = self.bench["input-voltage-1"] if live else 0.0
        return millivolts / (10000 if sensor == VOLT else 60)

    def raw(self):
        """The reading in digits before the calibration; None: sensor error."""
        sensor, wiring = self.p(1), self.bench["input-wiring-1"]
        if sensor < VOLT:
            celsius = self.temperature()
            if wiring == "shorted" and sensor < 8:
                celsius = self.bench["terminal-temperature"]  # no voltage but that of the junction
            low, high = RANGES[sensor]
            broken = wiring == "broken" or wiring == "shorted" and sensor >= 8
            return None if broken or not low <= celsius <= high else self.in_degrees(celsius)
        part = self.share()
        if part is None:
            return None
        low, high, zero = self.p(3), self.p(4), self.kept["zero"]
        if self.p(9) < 2 or zero is None:
            return low + part * (high - low)
        if self.p(9) == 3:
            return (part - zero) * (high - low)  # one straight line
        # The ends stay, so that the scale has a bend at zero (7.11).
        if part <= zero:
            return low * (1 - part / zero) if zero else 0.0
        return high * (part - zero) / (1 - zero) if zero < 1 else 0.0

    def share(self):
        """The linear signal as a share of the scale that latch-on has bound."""
        part = self.fraction()
        if part is None:
            return None
        if self.p(9) and self.kept["latch"]:
            low, high = self.kept["latch"]
            part = (part - low) / (high - low) if high != low else 0.0
        return part if self.p(6) else clamp(part, 0.0, 1.0)

    def latch(self, sub, value):
        """The procedure of 7.11."""
        part = self.fraction() or 0.0
        low, high = self.kept["latch"] or (0.0, 1.0)
        if sub == 1:
            self.latch_since = self.now if value else None
        elif sub == 2 and value:
            self.kept["latch"] = (part, high)
        elif sub == 3 and value:
            self.kept["latch"] = (low, part)
        elif sub == 4 and value == 1:
            self.kept["zero"] = self.share()
        elif sub == 4 and value == 2:
            self.kept["zero"] = None

    def measure(self):
        if self.latch_since is not None and self.now >= self.latch_since + 120:
            self.latch_since = None
        raw = self.raw()
        if raw is None:
            self.samples = []
            if self.p(1) < VOLT and self.bench["input-wiring-1"] != "shorted":
                # Out of the range its end is shown, of a broken wire the upper one (open); an NTC
                # without current is very cold.
                low, high = RANGES[self.p(1)]
                broken = self.bench["input-wiring-1"] == "broken"
                end = low if self.p(1) == NTC else high
                celsius = end if broken else clamp(self.temperature(), low, high)
                self.process = self.in_degrees(celsius)
            return True
        value = raw * (1 + self.p(8) / 1000) + self.p(7)
        if not self.samples or self.now >= self.sampled_at + 0.1:
            # Every 100 ms, however late it is looked at.
            late = (self.now - self.sampled_at) % 0.1 if self.samples else 0.0
            self.sampled_at = self.now - late
            self.samples.append(value)
        self.samples = self.samples[-self.p(10):]
        self.process = rounded(clamp(sum(self.samples) / len(self.samples), -32768, 32767))
        return False

    # ---- Errors (11.3.10, 11.9) ----

    def look_for_errors(self, broken):
        flags = 0
        if not 0 <= self.bench["terminal-temperature"] <= 50 and self.p(1) < 8:
            flags |= 1 << COLD_JUNCTION  # 3.2
        flags |= broken << PROCESS | self.bench["machine-fault"] << HARDWARE_ERROR
        before, self.flags = self.flags, flags | self.memory_flags | self.load_errors()
        if self.flags and not before:
            self.error_at = self.now
        self.failed_now = bool(flags & (1 << PROCESS | 1 << COLD_JUNCTION | 1 << HARDWARE_ERROR))

    def use_memory(self, what):
        """A part of the memory fails when it is used: at a save, or when it is read at a start."""
        fault = self.bench["memory-fault"]
        if fault != "none" and (fault == "write") == (what == "write"):
            self.memory_flags |= 1 << MEMORY_FAULTS[fault]
            return True
        return False

    def amperes(self):
        """Tenths of an ampere: 50 mA are the value of the transformer (11.3.2, 91)."""
        return self.bench["transformer-current-1"] / 50 * self.p(91) * 10 if self.p(90) else 0.0

    def load_errors(self):
        """Heater break and overcurrent (7.7)."""
        amperes, limit, over = self.amperes(), self.p(92), self.p(93)
        # Parameter 131 is one of the expansion module; else the load is that of the command.
        on = self.q[self.p(131)] if self.p(121) else self.heats
        seen = {SHORT: limit and not on and amperes >= limit,
                OPEN: limit and on and amperes < 1,
                PARTIAL: limit and on and 1 <= amperes < limit,
                OVER: over and amperes > over}
        flags = 0
        for bit, present in seen.items():
            if not self.p(90) or not present:
                # While the load is off, nothing is known of a heater, and the delay goes on.
                if not self.p(90) or bit == OVER or on == (bit != SHORT) or not limit:
                    self.load_since.pop(bit, None)
            else:
                self.load_since.setdefault(bit, self.now)
            if bit in self.load_since and self.now >= self.load_since[bit] + self.p(94):
                flags |= 1 << bit
        return flags

    def bus_fault(self, fault):
        if self.state is None or self.boots_at is not None:
            return
        if fault != "error-passive":
            self.clear_error("passive", 0, bytes(5))
        if fault == "receive-overflow":
            self.emergency(0x8110, 0x11, b"\0\1\0\0\0")
            self.failed()
        elif fault == "transmit-overflow":
            self.emergency(0x8110, 0x11, b"\0\2\0\0\0")
            self.failed()
        elif fault == "error-passive":
            self.set_error("passive", 0x8120, 0x11, b"\0\3\0\0\0")

    def module_fault(self, fault):
        if self.state is None or self.boots_at is not None:
            return
        if fault == "broken":
            self.set_error("module", 0xFF00, 0x81, b"\0\6\1\0\0")
            self.enter(STOPPED)
        elif fault == "faulty":
            self.set_error("module", 0xFF00, 0x81, b"\1\7\1\1\1")
        else:
            self.clear_error("module", 0, bytes(5))

    # ---- Set point, soft start, tuning ----

    def setpoint(self):
        """The set point that is controlled: a soft start with a gradient moves it (7.9)."""
        target = self.od[0x4000, 0].value
        if self.soft_since is not None and self.p(80) == 1 and self.ramp is not None:
            return rounded(self.ramp)
        return target

    def soft_start(self, dt):
        if self.soft_since is None or not self.running:
            return
        limit, target = self.p(84) * 60, self.od[0x4000, 0].value
        if limit and self.now >= self.soft_since + limit:
            self.soft_since = None
        elif self.p(80) == 1:
            if self.ramp is None:
                self.ramp = float(self.process)
            move = self.p(81) * dt / 3600
            self.ramp += clamp(target - self.ramp, -move, move)
            if self.ramp == target:
                self.soft_since = None
        elif self.p(80) == 2 and self.process > self.p(83):
            self.soft_since = None

    def tuned_output(self):
        """The output that a tuning asks for, in percent; None: it asks for none."""
        kind = self.p(31)
        if kind == 4 and self.tune and self.now >= self.tune_read + 10:
            self.tune = 0  # the master does not ask any more (7.5)
        if kind == 4 and self.tune in (1, 2, 4):
            return 100.0 if self.tune == 2 else 0.0
        if self.tune == 0 or kind == 4 and self.tune != 3:
            return None
        return self.relay(kind)

    def relay(self, kind):
        """Full power up to a threshold, then none until the process turns: open in the manual."""
        if self.tune_data is None:
            gap = self.p(32) if kind == 2 else 0
            self.tune_data = [self.now, self.process, self.setpoint() - gap, None]
        begun, first, threshold, top = self.tune_data
        rising = 1 if self.p(18) == 0 else -1
        if top is None:
            if (self.process - threshold) * rising < 0:
                return 100.0
            self.tune_data[3] = top = self.process
        if (self.process - top) * rising > 0:
            self.tune_data[3] = self.process
        if (self.process - self.tune_data[3]) * rising > -5:
            return 0.0
        swing = abs(self.tune_data[3] - threshold)
        band = clamp(2 * swing + 10, self.p(48), max(self.p(48), self.p(49)))
        integral = clamp(rounded((self.now - begun) * 10), self.p(50), 20000)
        for sub, value in ((33, band), (34, integral), (35, min(integral // 4, 10000))):
            self.od[0x3000, sub].value = value
        self.tune, self.tune_data = 4 if kind == 4 else 0, None
        self.kept["tuned"] = kind == 3 or self.kept["tuned"]
        return 0.0

    # ---- The command ----

    def is_on_off(self):
        return self.p(33) == 0 and self.p(34) == 0

    def cooling_alarm(self):
        """The alarm that is the cold actuator (7.8)."""
        if self.is_on_off():
            return None
        return next((a for a in self.alarms if self.p(a.base) == 9), None)

    def on_off(self, error):
        """The contact in ON/OFF, with hysteresis, delay and manual reset (19, 22, 23)."""
        hysteresis, delay = self.p(19), self.p(23)
        wanted = self.contact
        if error <= min(0, hysteresis):
            wanted = False
        elif error >= max(0, hysteresis):
            wanted = True
        self.wanted = wanted
        if not wanted and self.contact and self.p(22):
            wanted = True  # until it is reset by 400Ah
        if wanted == self.contact:
            self.contact_since = None
        else:
            if self.contact_since is None:
                self.contact_since = self.now
            waits = max(delay, 0) if wanted else max(-delay, 0)
            if self.now >= self.contact_since + waits:
                self.contact, self.contact_since = wanted, None
        self.kept["command"] = self.contact
        return 100.0 if self.contact else 0.0

    def contact_can_be_reset(self):
        return bool(self.is_on_off() and self.p(22) and self.contact and not self.wanted)

    def pid(self, error, dt):
        """Heating and cooling in percent (7.8; 33 to 46)."""
        band = self.p(33) or 1  # 0 beside an integral time: open
        if abs(error) <= self.p(36):
            error = 0
        # The derivative acts on the process alone, so that a new set point gives no kick (open).
        towards = self.process * (1 if self.p(18) else -1)
        if self.last_process is None:
            self.last_process = towards
        elif dt > 0:  # steps between two ticks take no time
            rate = (towards - self.last_process) / dt
            self.slope += (rate - self.slope) * min(1.0, dt / 0.2)
            self.last_process = towards
        cools = self.cooling_alarm() is not None
        centre = 50.0 if self.p(37) and not cools else 0.0
        base = error / band * 100 + self.p(35) / 10 * self.slope / band * 100 + centre
        low, high = self.p(45), self.p(46)
        if self.p(34):
            grown = self.integral + error / band * 100 * dt / (self.p(34) / 10)
            floor = -100 if cools else low  # it reaches the limits, and goes no further
            least = min(floor - base, self.integral)
            self.integral = clamp(grown, least, max(high - base, self.integral))
        else:
            self.integral = 0.0
        total = base + self.integral
        heat = clamp(total, low, max(low, high))
        if self.p(38) and error < -self.p(39):
            heat = 0.0  # off over set point (38, 39)
        cold = 0.0
        if cools:
            # A positive value overlaps, in percent of the heating band (43).
            cold = clamp((self.p(43) / 10 - total) / (self.p(42) / 100), 0.0, 100.0)
        return heat, cold

    def control(self, dt):
        error = (self.setpoint() - self.process) * (-1 if self.p(18) else 1)
        if self.failed_now:
            self.cold = 0.0
            self.percent = self.percent if self.manual else 0
            return
        tuned = self.tuned_output()
        if tuned is not None:
            heat, self.cold = tuned, 0.0
        elif self.manual:
            self.cold = 0.0
            return
        elif self.is_on_off():
            heat, self.cold = self.on_off(error), 0.0
        else:
            heat, self.cold = self.pid(error, dt)
        if self.soft_since is not None and self.p(80) == 2:
            heat = float(self.p(82))
        self.percent = rounded(heat * 100)

    def cycle(self, percent, begun, length):
        """A contact that is on for a part of each cycle."""
        return (self.now - begun) % length < percent / 100 * length

    # ---- Alarms (9, 11.3.2: 56 to 74) ----

    def alarm_condition(self, alarm):
        kind, process, real = self.p(alarm.base), self.process, self.setpoint()
        own, hysteresis = self.od[0x4000 + alarm.number, 0].value, self.p(alarm.base + 2)
        above = {1: process, 3: abs(process - real), 4: process - real, 6: real}
        below = {2: process, 5: process - real, 7: real}
        if kind in above or kind in below:
            value = above.get(kind, below.get(kind))
            sign = 1 if kind in above else -1
            threshold = -own if kind == 5 else own
            on = max(sign * threshold, sign * (threshold + hysteresis))
            off = min(sign * threshold, sign * (threshold + hysteresis))
            value *= sign
            return value >= on if not alarm.condition else value > off or value >= on
        return {8: self.running, 10: bool(self.flags & 0b11110000000),
                11: bool(self.flags & 1 << PROCESS),
                12: bool(self.od[0x400B + alarm.number, 0].value)}.get(kind, False)

    def alarm(self, alarm):
        """Whether the alarm is active."""
        kind = self.p(alarm.base)
        if kind in (0, 9):
            alarm.clear(False)
            return
        if not (self.sensor_failed and 1 <= kind <= 5):
            alarm.condition = self.alarm_condition(alarm)
        if not alarm.condition:
            alarm.inhibited = False
        wanted = alarm.condition
        if self.p(alarm.base + 1) >= 2 and alarm.inhibited:
            wanted = False
        delay = self.p(alarm.base + 6)
        if wanted == alarm.active or not wanted and alarm.latched:
            alarm.since = None
        else:
            if alarm.since is None:
                alarm.since = self.now
            if self.now >= alarm.since + (max(delay, 0) if wanted else max(-delay, 0)):
                alarm.active, alarm.since = wanted, None
        if alarm.active and self.p(alarm.base + 5):
            alarm.latched = True
        elif not self.p(alarm.base + 5):
            alarm.latched = False

    def alarm_output(self, alarm):
        """The output of an alarm: closed or open, or a current in mA when a state asks for one."""
        base, kind = alarm.base, self.p(alarm.base)
        if kind == 0:
            return False
        if self.failed_now and kind != 11:
            return STATE_CURRENTS[self.p(base + 3)]
        if not self.running and self.p(base + 4) < 4:
            return STATE_CURRENTS[self.p(base + 4)]
        if kind == 9:
            if self.command_place() < 4 and self.alarm_place(alarm) == "ao":
                return ("percent", self.cold)
            return self.cycle(self.cold, self.cold_at, self.p(44))
        return alarm.active != bool(self.p(base + 1) & 1)

    # ---- Outputs ----

    def command_place(self):
        return self.p(16)

    def alarm_place(self, alarm):
        """Where an alarm comes out (16)."""
        places = {0: ("q2", "ao"), 1: ("ao", None), 2: ("q1", "q2")}
        return places[self.p(16) // 2][alarm.number - 1]

    def forced(self):
        """What the command shows in an error or in STOP: an entry of 20 or 21, or None."""
        if self.bench["key"]:
            return None  # it enables the command (6.2)
        if self.failed_now and not (self.manual and self.running):
            return self.p(20)
        return None if self.running else self.p(21)

    def outputs(self, dt):
        place, forced = self.p(16), self.forced()
        key = self.bench["key"]  # 6.2: in STOP, too (open)
        percent = 100.0 if key else self.percent / 100
        if self.offline:
            percent = 0.0
        q, current = [False, False], None
        self.heats = bool(forced & 1) if forced is not None else percent > 0
        if place in (0, 1):
            if forced is None:
                self.heats = self.contact_now(percent)
            q[0] = self.heats
        elif place in (2, 3):
            q = self.valve(percent, forced, dt)
        else:
            current = STATE_CURRENTS[forced] if forced is not None else self.scaled(percent, place)
        for alarm in self.alarms:
            where, output = self.alarm_place(alarm), self.alarm_output(alarm)
            if where in ("q1", "q2"):
                on = output in (4.0, 21.5) if isinstance(output, float) else bool(output)
                q[where == "q2"] = on
            elif where == "ao":
                current = self.alarm_current(output, place)
        if place < 4 and self.p(100):
            current = self.retransmitted()
        self.q, self.current = q, current or 0.0

    def alarm_current(self, output, place):
        if isinstance(output, float):
            return output
        return self.scaled(output[1] if isinstance(output, tuple) else 100.0 * output, place)

    @staticmethod
    def scaled(percent, kind):
        """A current in mA: odd kinds begin at 4 mA."""
        return 4 + percent * 0.16 if kind & 1 else percent * 0.2

    def contact_now(self, percent):
        if self.is_on_off() and not self.manual:
            return percent > 0
        return self.cycle(percent, self.cycle_at, self.p(40))

    def valve(self, percent, forced, dt):
        """Q1 opens, Q2 closes; the position is known from the valve time (24)."""
        if forced is not None:
            percent = 0.0 if forced & 1 else 100.0
        travel = dt * 100 / self.p(24)
        # An end is approached until the travel time says that it is reached (open).
        if percent > self.position and (percent >= 100 or percent > self.position + 1):
            move = 1
        elif percent < self.position and (percent <= 0 or percent < self.position - 1):
            move = -1
        else:
            move = 0
        self.position = clamp(self.position + move * travel, 0.0, 100.0)
        return [move > 0, move < 0]

    def retransmitted(self):
        """The retransmitted value as a current (7.10, 100 to 105)."""
        if self.failed_now:
            return STATE_CURRENTS[self.p(104)]
        if not self.running and self.p(105) < 4:
            return STATE_CURRENTS[self.p(105)]
        objects = {2: 0x4000, 3: 0x4001, 4: 0x4002, 6: 0x4010}
        kind = self.p(100)
        value = self.process if kind == 1 else self.amperes() if kind == 5 else (
            self.od[objects[kind], 0].value)
        return self.along(value, self.p(102), self.p(103), self.p(101))

    def along(self, value, low, high, kind):
        part = (value - low) / (high - low) if high != low else 0.0
        return self.scaled(clamp(part, 0.0, 1.0) * 100, kind)

    def expansion(self):
        """The outputs are those of the master (7.12)."""
        if (self.failed_now or self.offline) and not self.error_mode:
            self.error_mode = True
            mode, bits = self.p(123), self.p(124)
            self.od[0x6200, 1].value = self.od[0x6200, 1].value & ~mode | bits & mode
            if self.p(129):
                self.od[0x6411, 1].value = self.p(130)
        bits = self.od[0x6200, 1].value
        self.q = [bool(bits & 1), bool(bits & 2)]
        value = self.od[0x6411, 1].value
        self.current = self.along(value, self.p(126), self.p(127), self.p(125))
        # 7.12: the functions of the controller are disabled.
        self.percent, self.cold, self.tune, self.tune_data = 0, 0.0, 0, None

    def error_outputs(self):
        """A communication error: 6206h, 6207h, 6443h and 6444h (11.4.2, 11.4.13)."""
        mode, bits = self.od[0x6206, 1].value, self.od[0x6207, 1].value
        self.od[0x6200, 1].value = self.od[0x6200, 1].value & ~mode | bits & mode
        if self.od[0x6443, 1].value:
            self.od[0x6411, 1].value = self.od[0x6444, 1].value

    def driven(self):
        """How much of heater and cooler the terminals switch on: what is at the outputs counts,
        also with the key (6.2) or in a state of 20 or 21."""
        place = self.p(16)
        low = 4.0 * (place & 1)
        analogue = clamp((self.current - low) / (20 - low), 0.0, 1.0)
        if place < 2:
            command, alarms = float(self.q[0]), (float(self.q[1]), analogue)
        elif place < 4:
            command, alarms = self.position / 100, (analogue, 0.0)
        else:
            command, alarms = analogue, (float(self.q[0]), float(self.q[1]))
        if self.p(18):
            return 0.0, command  # the command cools
        cools = [share for share, alarm in zip(alarms, self.alarms) if self.p(alarm.base) == 9]
        return command, max(cools, default=0.0)

    # ---- A step of the controller ----

    def step(self):
        if self.state is None:
            return
        dt, self.stepped = self.now - self.stepped, self.now
        dt = clamp(dt, 0.0, 1.0)
        self.running = bool(self.od[0x4003, 0].value)
        # A load for the stimulus `process`, which no manual describes: that of the bench of the
        # reference device, with a heater of 300 K, a cooler of 100 K, and a sensor that lags.
        heating, cooling = self.driven()
        end = 25 + 300 * heating - 100 * cooling
        load, sensor = math.exp(-dt / 100), math.exp(-dt / 2)
        away = self.load_at - end
        self.load_at = end + away * load
        self.plant = end + (self.plant - end) * sensor + away * (load - sensor) * 100 / 98
        broken = self.measure()
        if self.p(115) and self.now >= self.heard_at + self.p(115) / 10:
            self.offline = True
        self.look_for_errors(broken)
        self.watch_sensor()
        if self.p(121):
            self.expansion()
        else:
            self.soft_start(dt)
            if self.running:
                self.control(dt)
            else:
                if not self.manual:
                    self.percent = 0
                self.cold, self.tune, self.contact = 0.0, 0, False
            for alarm in self.alarms:
                self.alarm(alarm)
            self.kept["latched"] = [a.latched for a in self.alarms]
            self.outputs(dt)
        self.press_key()

    def watch_sensor(self):
        broken = bool(self.flags & 1 << PROCESS)
        if broken and not self.broken and self.p(25) == 2 and not self.manual:
            self.switch_manual(True)  # 7.6: the output stays as it was
        self.broken = broken
        self.sensor_failed = bool(self.flags & (1 << PROCESS | 1 << COLD_JUNCTION))

    def press_key(self):
        """Three seconds take the threshold of the heater break alarm (6.2, 7.7)."""
        if not self.bench["key"]:
            self.key_since, self.key_done = None, False
        elif self.key_since is None:
            self.key_since, self.key_done = self.now, False
        elif self.now > self.key_since + 3 and not self.key_done and self.p(90):
            self.key_done = True
            # How much below the current is open; no current is no threshold.
            if self.amperes() > 0:
                self.od[0x3000, 92].value = clamp(rounded(self.amperes() * 0.8), 1, 2000)

    def tick(self):
        if self.state is not None:
            self.step()
        if self.state is not None and self.boots_at is None:
            self.watch_inputs()
        super().tick()
        self.run_led()

    # ---- The bench ----

    def stimulate(self, name, value):
        if name not in STIMULI:
            raise ValueError(f"the bench has no `{name}`" if name not in OBSERVATIONS
                             else f"{name} cannot be set")
        allowed = STIMULI[name][1]
        value = int(value) if isinstance(value, bool) else value
        if isinstance(allowed, set):
            fits = value in allowed
        elif isinstance(value, str):
            fits = name == "input-temperature-1" and value == "process"
        else:
            fits = allowed[0] <= value <= allowed[1]
        if not fits:
            raise ValueError(f"{name} is not {value!r}")
        before, self.bench[name] = self.bench[name], value
        if name == "power":
            if value == "off":
                self.power_off()
            elif before == "off":
                self.power_on()
        elif self.bench["power"] == "off":
            return
        elif name == "dip-switch-2" and self.loading and not value & 8:
            self.loading = False
            self.power_on()  # reopened: the device restarts (7.1)
        elif name == "bus-fault" and value != before:
            self.bus_fault(value)
        elif name == "module-1" and value != before:
            self.module_fault(value)
        self.tick()

    def observe(self, name):
        if name in self.bench:
            return self.bench[name]
        self.step()
        if name == "digital-outputs-1":
            return self.q[0] | self.q[1] << 1
        if name == "output-current-1":
            return rounded(self.current * 1000)  # uA
        if name == "run-led":
            return int(self.run_led())
        if name in OBSERVATIONS:
            return int(self.output_led(int(name[-1]) - 1))
        raise ValueError(f"the bench has no `{name}`")

    def blinks(self, half):
        """On first, from when the pattern began (open)."""
        return int((self.now - self.pattern_at) / half) % 2 == 0

    def run_led(self):
        """Chapter 10."""
        pattern = (self.loading, self.state, bool(self.register()))
        if pattern != self.pattern:
            self.pattern, self.pattern_at = pattern, self.now
        at = self.now - self.pattern_at
        if self.loading:
            return self.blinks(0.05)
        if self.state is None:
            return False
        if self.state == BOOT:
            return self.blinks(0.05)
        if not self.register():
            if self.state == PRE:
                return self.blinks(0.6)
            return self.state == OPERATIONAL or at % 1.2 < 0.04
        if self.state == PRE:
            return self.blinks(0.2)
        # On or off for a second, then three blinks of 150 ms.
        at %= 1.9
        blink = at >= 1 and int((at - 1) / 0.15) % 2 == 0
        return blink if self.state == STOPPED else not blink

    def output_led(self, place):
        """Chapter 6.1."""
        if self.loading:
            return self.blinks(0.05)
        if self.state is None:
            return False
        if self.bench["key"] and self.command_place() < 2 and place == 0:
            half = 0.5 if self.key_done else 0.05
            return int((self.now - (self.key_since or self.now)) / half) % 2 == 0
        if self.flags:
            # In turns; period and beginning are open.
            return (int((self.now - self.error_at) / 0.5) % 2 == 0) != bool(place)
        return self.q[place]


class Bench:
    """The socket of the bench: `names`, `get` and `set`, a JSON object a line."""

    def __init__(self, device, path):
        self.device, self.path, self.clients = device, path, {}
        if os.path.exists(path):
            os.unlink(path)
        self.listener = socket.socket(socket.AF_UNIX)
        self.listener.bind(path)
        self.listener.listen()

    def sockets(self):
        return [self.listener, *self.clients]

    def ready(self, sock):
        if sock is self.listener:
            self.clients[sock.accept()[0]] = b""
            return
        try:
            got = sock.recv(65536)
        except OSError:
            got = b""
        if not got:
            del self.clients[sock]
            return sock.close()
        *lines, self.clients[sock] = (self.clients[sock] + got).split(b"\n")
        for line in lines:
            sock.sendall(json.dumps(self.answer(line)).encode() + b"\n")

    def answer(self, line):
        try:
            request = json.loads(line)
            if "names" in request:
                return {"names": [*STIMULI, *OBSERVATIONS]}
            if "get" in request:
                return {"value": self.device.observe(request["get"])}
            for name, value in request["set"].items():
                self.device.stimulate(name, value)
            return {"ok": True}
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            return {"error": str(error)}


LINE = re.compile(rb"(?:\([\d.]+\)\s+\w+\s+)?([0-9A-Fa-f]+)#(R?)([0-9A-Fa-f]*)")


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--node", type=int, help="what the first DIP switch says")
    arguments.add_argument("--bench-socket", help="where the bench is served")
    options = arguments.parse_args()
    origin = time.monotonic()
    out = []

    def send(identifier, data):
        stamp = time.monotonic() - origin
        out.append(f"({stamp:.6f}) can0 {identifier:03X}#{data.hex().upper()}\n")

    device = Drr460(send, options.node)
    bench = Bench(device, options.bench_socket) if options.bench_socket else None
    device.now = time.monotonic() - origin
    device.power_on()
    pending = b""
    while True:
        if out:
            sys.stdout.write("".join(out))
            sys.stdout.flush()
            out.clear()
        now = time.monotonic() - origin
        due = device.next_due()
        wait = STEP if due is None else clamp(due - now, 0.0, STEP)
        ready = select.select([0, *(bench.sockets() if bench else [])], [], [], wait)[0]
        device.now = time.monotonic() - origin
        device.tick()
        for source in ready:
            if source != 0:
                bench.ready(source)
                continue
            got = os.read(0, 65536)
            if not got:
                return
            *lines, pending = (pending + got).split(b"\n")
            for line in lines:
                match = LINE.match(line.strip())
                if match and len(match[1]) <= 3:
                    device.frame(int(match[1], 16), b"" if match[2] else bytes.fromhex(
                        match[3].decode()), bool(match[2]))
            device.step()
            device.watch_inputs()


if __name__ == "__main__":
    main()
