"""A Pixsys MCM260X-9AD as a program, written from its manual alone (clauses "M ...").

It speaks lines of candump on standard input and output, and serves its bench on a socket:
`mcm260x_9ad.py [--node N] [--bench-socket PATH]`. It stores parameters in memory only.
"""

import argparse
import json
import math
import os
import select
import socket
import sys
import time
from collections import deque

import node_mcm260x as canopen
from node_mcm260x import NEVER, Abort, Node

# M 8.b, parameters 21 to 24: the ranges of temperature sensors in degrees Celsius.
TEMPERATURES = {
    1: (-260, 1360), 2: (-40, 1760), 3: (-40, 1760), 4: (-200, 1200), 5: (-260, 400),
    6: (-260, 980), 7: (-260, 1280), 8: (100, 1820), 9: (-100, 600), 10: (-60, 180),
    11: (-40, 125), 12: (-50, 150), 13: (-100, 600), 14: (-100, 600),
}
THERMOCOUPLES, NTC = range(1, 9), 11
VOLTAGES = {15: 1000, 16: 5000, 17: 10000, 20: 60}           # full scale in mV
CURRENTS = {18: (0, 20000), 19: (4000, 20000)}               # uA
FREQUENCIES = [4, 6, 8, 10, 12, 17, 20, 33, 39, 50, 62, 123, 242, 470]   # Hz, parameters 58, 59
BEYOND = 0.05      # how far a signal may leave its range before it is an error; M 12 says nothing

# Bits of 4007h sub 1 and 2 (M 11.3.8) by the fault of the bench that sets them.
MEMORY_FAULTS = {"parameters": 0, "encoder-counts": 1, "calibrations": 3,
                 "calibration-constants": 4, "communication-data": 5, "calibration-missing": 6,
                 "read": 8}
TERMINAL_FAULTS = {"read": 0, "write": 1, "parameters": 2}
SPEED = 6                                                    # of the bus, parameter 3: 1 Mbit/s
LOWEST_SUPPLY = 12 * 0.85                                    # M 3.2.f

# M 10 and 9: on and off in ms, again and again.
BLINK_FAST, BLINK_MEDIUM, BLINK_SLOW = [50, 50], [200, 200], [600, 600]
BLINK_3_ON = [1000] + [150] * 5
BLINK_3_OFF = [0, 1000] + [150] * 5
BLINK_1_OFF = [40, 1160]
LIT = [1, 0]

# Parameters of 3000h (M 8): first, last, low, high, default. The others are reserved.
PARAMETERS = [
    (1, 1, 0, 1, 0), (2, 2, 1, 127, None), (3, 3, 0, 6, 6), (4, 4, 1, 254, 1), (5, 5, 0, 7, 7),
    (6, 6, 0, 5, 0), (7, 7, 0, 250, 1), (10, 10, 0, 2, 0), (13, 13, 0, 8888, 1234),
    (14, 14, 0, 1, 0), (21, 24, 0, 21, 0), (25, 25, 0, 2, 0), (26, 29, -32767, 32767, 0),
    (30, 33, -32767, 32767, 1000), (34, 37, 1, 150, 10), (38, 41, 0, 1, 0),
    (42, 45, -10000, 10000, 0), (46, 49, -1000, 1000, 0), (54, 57, 1, 50, 10), (58, 59, 0, 13, 5),
    (60, 61, 0, 1, 0), (62, 63, -32767, 32767, 0), (64, 65, -32767, 32767, 1000),
    (66, 67, -32767, 32767, 0), (72, 72, 0, 200, 2), (73, 76, 0, 6, 0), (77, 84, -32767, 32767, 0),
    (85, 88, 1, 32767, 30), (89, 92, 0, 200, 45),
]


def to_i16(value):
    return max(-32768, min(32767, math.floor(value + 0.5)))


def to_i32(value):
    return (value + 0x80000000) % 0x100000000 - 0x80000000


class Input:
    """The filter of an analogue input."""

    def __init__(self):
        self.kind = 0
        self.samples = deque(maxlen=50)
        self.next = NEVER          # when the next sample is taken
        self.rejecting = None      # since when samples are rejected
        self.error = False
        self.sent = 0              # the value last transmitted

    def restart(self, kind, now):
        self.kind, self.rejecting, self.error = kind, None, False
        self.samples.clear()
        self.next = now if kind else NEVER

    def average(self, count):
        last = list(self.samples)[-count:]
        return sum(last) / len(last) if last else 0.0

    def take(self, sample, right, now, count, difference, longest):
        """M 8.b, parameters 54 to 57 and 85 to 92."""
        if self.error or not right:
            self.samples.clear()
            self.error = not right
        if self.samples and abs(sample - self.average(count)) > difference:
            self.rejecting = now if self.rejecting is None else self.rejecting
            if now - self.rejecting < longest:
                return
            # Any sample is valid now. Whether the average begins anew is open.
            self.samples.clear()
        self.rejecting = None
        self.samples.append(sample)


class Encoder:
    """An encoder with its counter."""

    def __init__(self):
        self.steps = 0.0           # quarters of a line, as the shaft stands
        self.frequency = 0.0       # lines a second
        self.lines = 0             # lines of a turn; none: no mark Z on the disc
        self.index = 0
        self.count = 0
        self.total = 0             # counts without loads of the preset, for the rates
        self.marks = [0, 0]        # `total` at the last second, and tenth of a second

    def counts(self, mode, before, after):
        """What the counter counts while the shaft goes from one position to another."""
        if mode in (1, 3):
            return (after + 1) // 2 - (before + 1) // 2
        if mode in (2, 4):
            return after - before
        if mode in (5, 6):
            # The counter input is phase A, which rises once in a line, whatever the direction.
            if after > before:
                edges = (after + 3) // 4 - (before + 3) // 4
            else:
                edges = (before + 1) // 4 - (after + 1) // 4
            return edges if mode == 5 else -edges
        return 0


class Module(Node):
    """The module."""

    def __init__(self, transmit, node_id):
        super().__init__(transmit, node_id)
        self.usual_node = node_id
        self.bench = {"power": "on", "supply-voltage": 24.0, "terminal-temperature": 25.0,
                      "memory-fault": "none", "terminal-fault": "none", "bus-fault": "none",
                      "module-1": "fitted", "communication-interface": "can"}
        for n in "1234":
            self.bench.update({"input-voltage-" + n: 0.0, "input-current-" + n: 0.0,
                               "input-temperature-" + n: 25.0, "input-potentiometer-" + n: 0.0,
                               "input-resistance-" + n: 10.0, "input-wiring-" + n: "connected"})
        self.levels = [0, 0]       # of the input terminals
        self.supplies = [1, 1]     # of the outputs
        self.inputs = [Input() for _ in range(4)]
        self.encoders = [Encoder() for _ in range(4)]
        self.on = True
        self.modbus = self.mute = self.off_line = False
        self.off_line_at = NEVER
        self.spoken = -NEVER       # when somebody read, wrote or commanded
        self.led_since = 0.0
        self.digital = [0, 0]      # what the outputs do
        self.analogue = [0, 0]
        self.seen = [0, 0]         # inputs behind the filter
        self.raw_since = [[0.0] * 8, [0.0] * 8]
        self.raw = [0, 0]
        self.ticks = [NEVER, NEVER]
        self.watched = {}
        self.overflow_end = NEVER
        self.unread = None         # the bit of 4007h sub 1 of what could not be read at the start
        self.board = "fitted"      # the board of the last start or store
        self.build()

    # The dictionary

    def build(self):
        self.build_communication()
        self.build_pdos()
        self.build_manufacturer()
        self.build_profile()

    def build_communication(self):
        define = self.define
        define(0x1000, 0, "u32", "ro", 0x000F0191)
        define(0x1001, 0, "u8", "ro", 0, pdo="t")
        define(0x1003, 0, "u8", "rw", 0, stored=False)
        for sub in range(1, 11):
            define(0x1003, sub, "u32", "ro", 0)
        define(0x1005, 0, "u32", "ro", 0x80)
        define(0x1006, 0, "u32", "rw", 0)
        define(0x1008, 0, "text", "ro", "M260")
        define(0x1009, 0, "text", "ro", "MCM260X-9AD HW 1.0")
        define(0x100A, 0, "text", "ro", "FW 1.00")
        define(0x100B, 0, "u8", "ro", lambda node: node)
        define(0x100C, 0, "u16", "rw", 0)
        define(0x100D, 0, "u8", "rw", 0)
        for index in (0x1010, 0x1011):
            define(index, 0, "u8", "ro", 1)
            define(index, 1, "u32", "rw", 1, stored=False)
        define(0x1014, 0, "u32", "ro", lambda node: 0x80 + node)
        define(0x1015, 0, "u16", "rw", 0)
        define(0x1016, 0, "u8", "ro", 4)
        for sub in range(1, 5):
            define(0x1016, sub, "u32", "rw", 0)
        define(0x1017, 0, "u16", "rw", 0)
        for sub, value in enumerate([4, 0x584950, 260, 0x02110001, 1]):
            define(0x1018, sub, "u32" if sub else "u8", "ro", value)
        define(0x1029, 0, "u8", "ro", 1)
        define(0x1029, 1, "u8", "rw", 0, 0, 2)

    def build_pdos(self):
        define = self.define
        mapping = {0x1600: [0x62000108, 0x62000208], 0x1601: [0x64110110, 0x64110210],
                   0x1A00: [0x60000108, 0x60000208],
                   0x1A01: [0x64010010 | sub << 8 for sub in range(1, 5)]}
        for n in range(4):
            for index, base in ((0x1400 + n, 0x200), (0x1800 + n, 0x180)):
                cob = base + 0x100 * n
                define(index, 0, "u8", "ro", 2 if base == 0x200 else 5)
                define(index, 1, "u32", "rw", lambda node, cob=cob: cob + node)
                define(index, 2, "u8", "rw", 255)
            define(0x1800 + n, 3, "u16", "rw", 50)
            define(0x1800 + n, 5, "u16", "rw", 0)
            for index in (0x1600 + n, 0x1A00 + n):
                entries = mapping.get(index, [])
                define(index, 0, "u8", "rw", len(entries))
                for sub in range(1, 9):
                    define(index, sub, "u32", "rw", (entries + [0] * 8)[sub - 1])

    def build_manufacturer(self):
        define = self.define
        define(0x2000, 0, "u8", "ro", 19)
        define(0x2000, 1, "i16", "ro", 6)
        define(0x2000, 2, "i16", "ro", 0)
        define(0x2000, 3, "i16", "rw", 120, 10, 1000)
        define(0x2000, 4, "i16", "rw", 127, 0, 127)
        define(0x2000, 5, "i16", "rw", 2, 0, 200)
        for sub in range(6, 20):
            define(0x2000, sub, "i16", "rw", 0)
        define(0x3000, 0, "u8", "ro", 100)
        for sub in range(1, 101):
            define(0x3000, sub, "i16", "rw", 0)
        for first, last, low, high, default in PARAMETERS:
            for sub in range(first, last + 1):
                default = (lambda node: node) if default is None else default
                define(0x3000, sub, "i16", "rw", default, low, high)
        for index in range(0x3001, 0x3006):
            define(index, 0, "u8", "ro", 4)
            for sub in range(1, 5):
                if index == 0x3003:
                    define(index, sub, "u8", "rw", 0, 0, 3, pdo="r")
                else:
                    writable = index == 0x3002
                    define(index, sub, "i32", "rw" if writable else "ro", 0,
                           pdo="r" if writable else "t")
        define(0x4007, 0, "u8", "ro", 2)
        define(0x4007, 1, "u16", "ro", 0, pdo="t")
        define(0x4007, 2, "u16", "ro", 0, pdo="t")

    def build_profile(self):
        self.define(0x6005, 0, "u8", "rw", 1, 0, 1)
        self.define(0x6423, 0, "bool", "rw", 0)
        arrays = [
            (0x6000, 2, "u8", "ro", 0, None, None, "t"), (0x6006, 2, "u8", "rw", 255),
            (0x6007, 2, "u8", "rw", 0), (0x6008, 2, "u8", "rw", 0),
            (0x6200, 2, "u8", "rw", 0, None, None, "r"), (0x6206, 2, "u8", "rw", 255),
            (0x6207, 2, "u8", "rw", 0), (0x6401, 4, "i16", "ro", 0, None, None, "t"),
            (0x6411, 2, "i16", "rw", 0, None, None, "r"), (0x6421, 4, "u8", "rw", 7, 0, 31),
            (0x6424, 4, "i16", "rw", 0), (0x6425, 4, "i16", "rw", 0), (0x6426, 4, "u16", "rw", 0),
            (0x6427, 4, "u16", "rw", 0), (0x6428, 4, "u16", "rw", 0),
            (0x6443, 2, "u8", "rw", 1, 0, 1), (0x6444, 2, "i16", "rw", 0, -32767, 32767),
            (0x67FE, 1, "u8", "rw", 0, 0, 2),
        ]
        for index, count, *rest in arrays:
            self.define(index, 0, "u8", "ro", count)
            for sub in range(1, count + 1):
                self.define(index, sub, *rest)

    def parameter(self, number):
        return self[0x3000, number]

    # What the node asks of the device

    def on_check(self, index, sub, value):
        if (index, sub) == (0x2000, 4) and value not in (0, 4, 5, 127):
            raise Abort(canopen.INVALID)
        # M 8.a, parameter 8: 0 to 60000, in 16 bits.
        if (index, sub) == (0x3000, 8) and value & 0xFFFF > 60000:
            raise Abort(canopen.INVALID)

    def on_write(self, index, sub, value):
        self.spoken = self.now
        if index == 0x3000:
            self.parameter_written(sub)
        elif (index, sub) == (0x2000, 5):
            self[0x3000, 72] = value
        elif index == 0x3002:
            # One register of 32 bits, two words (M 8.d, parameters 77 to 84).
            high, low = value >> 16, value & 0xFFFF
            self[0x3000, 75 + 2 * sub] = high
            self[0x3000, 76 + 2 * sub] = low - 0x10000 if low > 0x7FFF else low
        elif index == 0x3003:
            self.load_preset(sub - 1)
        elif index == 0x1029:
            # M 11.4.20: 67FEh has the meaning of 1029h.
            self[0x67FE, 1] = value
        elif index == 0x67FE:
            self[0x1029, 1] = value
        elif index == 0x6200:
            # M 11.4.7: error values last beyond the error; until the next value, as read here.
            self.digital[sub - 1] = value
        elif index == 0x6411:
            self.analogue[sub - 1] = value
        elif index == 0x6444:
            # M 11.4.19 and 8.c, parameters 66 and 67: one value, it seems.
            self[0x3000, 65 + sub] = value

    def parameter_written(self, number):
        value = self.parameter(number)
        if number == 3:
            self[0x2000, 1] = value            # M 11.3.1
        elif number == 72:
            self[0x2000, 5] = value
        elif number in (66, 67):
            self[0x6444, number - 65] = value
        elif 77 <= number <= 84:
            self.join_preset((number - 77) // 2 + 1)
        elif 21 <= number <= 24:
            self.inputs[number - 21].restart(value, self.now)
            self[0x6401, number - 20] = 0

    def join_preset(self, encoder):
        high, low = self[0x3000, 75 + 2 * encoder], self[0x3000, 76 + 2 * encoder]
        self[0x3002, encoder] = to_i32(high << 16 | low & 0xFFFF)

    def on_upload(self):
        self.spoken = self.now

    def on_read(self, index, sub):
        if index == 0x1001:
            self[index, 0] = self.error_register()
        elif index == 0x1003:
            count = len(self.history)
            self[index, 0] = count
            for place in range(10):
                self[index, place + 1] = self.history[place] if place < count else 0
        elif index == 0x4007:
            self[index, 1], self[index, 2] = self.flags()

    def flags(self):
        bench = self.bench
        first = second = 0
        if self.unread is not None:
            first |= 1 << self.unread
        if bench["terminal-fault"] == "off-line":
            first |= 1 << 9
        elif bench["terminal-fault"] in TERMINAL_FAULTS:
            second |= 1 << TERMINAL_FAULTS[bench["terminal-fault"]]
        for n in (0, 1):
            # M 8.c, parameters 66 and 67: the value must lie between the limits.
            limits = sorted((self.parameter(62 + n), self.parameter(64 + n)))
            if not limits[0] <= self.parameter(66 + n) <= limits[1]:
                first |= 1 << 7
        if bench["supply-voltage"] < LOWEST_SUPPLY:
            first |= 1 << 11
        for channel, one in enumerate(self.inputs):
            first |= one.error << 12 + channel
        return first, second

    def on_store(self):
        if self.bench["memory-fault"] == "write":
            self.failed("flash", 0x5000, 0x81, [0, 2, 0, 0, 0])
            raise Abort(canopen.HARDWARE)
        self.save()
        self.over("flash")
        self.board = self.bench["module-1"]
        self.over("hardware")

    def on_node_id(self):
        self.node_id = (self.stored or {}).get((0x3000, 2), self.usual_node)

    def on_boot_time(self):
        return self[0x2000, 3] / 100

    def on_booted(self):
        self.state = canopen.PRE_OPERATIONAL
        if "other" in (self.bench["module-1"], self.board) and self.board != self.bench["module-1"]:
            self.failed("hardware", 0x5000, 0x81, [0, 1, 0, 0, 0])
        if self.unread in (0, 5):
            # Settings, or those of CANopen, that cannot be those that were made.
            self.failed("unread", 0x5000, 0x81, [0, 3, 1, 1, 1 if self.unread == 0 else 2])
        self.module_fault()
        if self.state == canopen.STOPPED:
            return self.state
        state = self[0x2000, 4]
        return state if state in (4, 5) else canopen.PRE_OPERATIONAL

    def on_reset(self, application):
        self.led_since = self.now
        self[0x67FE, 1] = self[0x1029, 1]
        if not application:
            return
        self[0x2000, 1] = self.parameter(3)
        self[0x2000, 5] = self.parameter(72)
        self[0x6444, 1], self[0x6444, 2] = self.parameter(66), self.parameter(67)
        for n in range(1, 5):
            self.join_preset(n)
        self.unread = MEMORY_FAULTS.get(self.bench["memory-fault"])
        self.modbus = self.parameter(1) == 1
        # A node with another speed than its bus has nobody to speak with.
        self.mute = self.modbus or self.parameter(3) != SPEED
        if self.mute:
            self.boot_end = NEVER
        self.digital, self.analogue = [0, 0], [0, 0]
        self.off_line, self.off_line_at = False, NEVER
        if self.modbus:
            self.outputs_off_line()
            if self.parameter(8):
                self.off_line_at = self.now + (self.parameter(8) & 0xFFFF) / 1000
        for channel, one in enumerate(self.inputs):
            one.restart(self.parameter(21 + channel), self.now)
            self[0x6401, channel + 1] = 0
        for encoder in self.encoders:
            encoder.marks = [encoder.total, encoder.total]
        for n in range(1, 5):
            self[0x3004, n] = self[0x3005, n] = 0
        self.ticks = [self.now + 1, self.now + 0.1]
        self.seen = [self.level(0), self.level(1)]
        self.raw = list(self.seen)
        self.show_inputs()

    def outputs_off_line(self):
        """M 8.a, parameter 12."""
        word = self.parameter(12)
        self.digital = [word & 0xFF, word >> 8 & 0xFF]

    def on_state(self, before, state):
        if state != before:
            self.led_since = self.spoken = self.now
        if state == canopen.STOPPED:
            # CiA 401: the error values are for a stopped node, too.
            self.outputs_to_error()

    def on_sent(self, mapped):
        for index, sub in mapped:
            if index == 0x6401:
                self.inputs[sub - 1].sent = self[0x6401, sub]

    def on_communication_error(self):
        """M 11.7, 11.8: outputs, and the state that 67FEh requires."""
        self.outputs_to_error()
        # The manual says "only if OPERATIONAL" of action 0; CiA 301 means it of each.
        if self.state == canopen.OPERATIONAL and self[0x67FE, 1] != 1:
            self.enter(canopen.STOPPED if self[0x67FE, 1] else canopen.PRE_OPERATIONAL)

    # Outputs

    def outputs_to_error(self):
        """M 11.4.7, 11.4.8, 11.4.18, 11.4.19."""
        for n in (0, 1):
            mode, value = self[0x6206, n + 1], self[0x6207, n + 1]
            self.digital[n] = self.digital[n] & ~mode | value & mode
            if self[0x6443, n + 1]:
                self.analogue[n] = self[0x6444, n + 1]

    def driven(self, block):
        return self.digital[block] if self.on and self.supplies[block] else 0

    def limited(self, n):
        low, high = sorted((self.parameter(62 + n), self.parameter(64 + n)))
        return max(low, min(high, self.analogue[n]))

    def share(self, n):
        """Where an analogue output is between its limits, 0 to 1 (M 8.c)."""
        low, high = self.parameter(62 + n), self.parameter(64 + n)
        if low == high or not self.on:
            return 0.0
        return max(0.0, min(1.0, (self.analogue[n] - low) / (high - low)))

    def output(self, n, kind):
        if not self.on or self.parameter(60 + n) != kind:
            return 0
        return to_i16(10000 * self.share(n) if kind == 0 else 4000 + 16000 * self.share(n))

    # Inputs

    def level(self, block):
        """A terminal is an input and an output at the same time (M 3.2.f)."""
        return self.levels[block] | self.driven(block)

    def digital_inputs(self):
        """M 8.d, parameter 72: what is stable for that time is valid."""
        needed = self.parameter(72) * 0.0005
        changed = False
        for block in (0, 1):
            level = self.level(block)
            for bit in range(8):
                if (level ^ self.raw[block]) >> bit & 1:
                    self.raw_since[block][bit] = self.now
            self.raw[block] = level
            before = self.seen[block]
            for bit in range(8):
                if (level ^ before) >> bit & 1 and self.now - self.raw_since[block][bit] >= needed:
                    self.seen[block] ^= 1 << bit
            if self.seen[block] != before:
                changed = True
                self.edges(block, before, self.seen[block])
        if changed:
            self.show_inputs()

    def show_inputs(self):
        self[0x6000, 1], self[0x6000, 2] = self.seen

    def edges(self, block, before, after):
        """M 11.4.2 to 11.4.5."""
        sub = block + 1
        rising, falling = after & ~before, before & ~after
        wanted = ((rising | falling) & self[0x6006, sub] | rising & self[0x6007, sub]
                  | falling & self[0x6008, sub])
        if self[0x6005, 0] and wanted:
            self[0x6000, sub] = after
            self.event((0x6000, sub))

    def signal(self, channel):
        """What an analogue input measures, in digits or tenths of a degree, and whether it can.

        Nothing says what an input in error shows (M 12): the end of its range.
        """
        kind, n = self.inputs[channel].kind, str(channel + 1)
        wiring = self.bench["input-wiring-" + n]
        if kind in TEMPERATURES:
            degrees = self.bench["input-temperature-" + n]
            if kind in THERMOCOUPLES:
                terminals = self.bench["terminal-temperature"]
                degrees = {"shorted": terminals, "broken": math.inf}.get(wiring, degrees)
                # M 3.2.f: the cold junction is compensated at 0 to 50 degrees.
                degrees += max(0, min(50, terminals)) - terminals
            elif wiring != "connected":
                # The resistance of an NTC falls with the temperature.
                degrees = math.inf if (wiring == "broken") == (kind != NTC) else -math.inf
            low, high = TEMPERATURES[kind]
            right = low <= degrees <= high
            degrees = max(low, min(high, degrees))
            unit = self.parameter(25)
            return 10 * [degrees, degrees * 1.8 + 32, degrees + 273.15][unit], right
        share = self.linear_share(kind, n, wiring)
        right = -BEYOND <= share <= 1 + BEYOND
        share = max(-BEYOND, min(1 + BEYOND, share))
        if not self.parameter(38 + channel):
            share = max(0.0, min(1.0, share))
        low, high = self.parameter(26 + channel), self.parameter(30 + channel)
        return low + share * (high - low), right

    def linear_share(self, kind, n, wiring):
        """Where a signal is in its range, 0 to 1."""
        if kind in VOLTAGES:
            wired = wiring == "connected"
            return self.bench["input-voltage-" + n] / VOLTAGES[kind] if wired else 0.0
        if kind in CURRENTS:
            low, high = CURRENTS[kind]
            current = {"broken": 0.0, "shorted": math.inf}.get(
                wiring, self.bench["input-current-" + n])
            return (current - low) / (high - low)
        if wiring == "broken":
            return math.inf
        # M 8.b, parameters 34 to 37: the resistance in kilohms that is all of the range.
        part = self.bench["input-potentiometer-" + n] / 100 if wiring == "connected" else 0.0
        whole = self.parameter(33 + int(n))
        return part * self.bench["input-resistance-" + n] / whole

    def analogue_inputs(self):
        for channel, one in enumerate(self.inputs):
            while one.next <= self.now:
                at, one.next = one.next, one.next + 1 / FREQUENCIES[
                    self.parameter(58 + channel // 2)]
                sample, right = self.signal(channel)
                one.take(sample, right, at, self.parameter(54 + channel),
                         self.parameter(85 + channel), self.parameter(89 + channel) / 10)
            if one.samples:
                value = one.average(self.parameter(54 + channel))
                if not one.error:
                    # M 8.b, parameters 46 to 49 in tenths of a percent, and 42 to 45.
                    value = value * (1 + self.parameter(46 + channel) / 1000)
                    value += self.parameter(42 + channel)
                self[0x6401, channel + 1] = to_i16(value)
            self.trigger(channel)

    def trigger(self, channel):
        """M 11.4.11 to 11.4.17."""
        sub = channel + 1
        value, sent = self[0x6401, sub], self.inputs[channel].sent
        kinds = self[0x6421, sub]
        if not self[0x6423, 0] or value == sent:
            return
        if (kinds & 1 and value >= self[0x6424, sub] or kinds & 2 and value <= self[0x6425, sub]
                or kinds & 4 and abs(value - sent) > self[0x6426, sub]
                or kinds & 8 and sent - value > self[0x6427, sub]
                or kinds & 16 and value - sent > self[0x6428, sub]):
            self.event((0x6401, sub))

    # Encoders

    def turn(self, elapsed):
        for n, encoder in enumerate(self.encoders):
            if encoder.frequency:
                self.move(n, encoder.steps + 4 * encoder.frequency * elapsed)

    def move(self, n, steps):
        """Turns the shaft."""
        encoder, mode = self.encoders[n], self.parameter(73 + n)
        before, after = math.floor(encoder.steps), math.floor(steps)
        encoder.steps = steps
        counts = encoder.counts(mode, before, after)
        encoder.total += counts
        encoder.count = to_i32(encoder.count + counts)
        turn = 4 * encoder.lines
        if turn and mode in (3, 4) and self[0x3003, n + 1] & 2 and before != after:
            # The mark that comes first on the way.
            place = before // turn + 1 if after > before else (before - 1) // turn
            mark = place * turn
            if min(before, after) <= mark <= max(before, after):
                self.load_from(n)
                encoder.count = to_i32(encoder.count + encoder.counts(mode, mark, after))

    def load_from(self, n):
        self.encoders[n].count = self[0x3002, n + 1]
        self[0x3003, n + 1] = 0

    def load_preset(self, n):
        """M 11.3.5 and 9.2.c: bit 0 at once, bit 1 at the next Z; both end by themselves."""
        if self[0x3003, n + 1] & 1:
            self.encoders[n].count = self[0x3002, n + 1]
            self[0x3003, n + 1] &= ~1
        self.show_encoders()

    def show_encoders(self):
        for n, encoder in enumerate(self.encoders):
            self[0x3001, n + 1] = encoder.count
        for index, (which, period) in {0x3004: (0, 1.0), 0x3005: (1, 0.1)}.items():
            if self.now >= self.ticks[which]:
                self.ticks[which] = max(self.ticks[which] + period, self.now)
                for n, encoder in enumerate(self.encoders):
                    self[index, n + 1] = to_i32(encoder.total - encoder.marks[which])
                    encoder.marks[which] = encoder.total

    # Time

    def advance(self, now):
        """Brings everything up to now."""
        elapsed, self.now = now - self.now, now
        if not self.on:
            return
        self.turn(elapsed)
        self.show_encoders()
        self.digital_inputs()
        self.analogue_inputs()
        if now >= self.off_line_at:
            # M 8.a, parameter 8, and 8.c, parameters 66 and 67: nobody speaks Modbus here.
            self.off_line, self.off_line_at, self.led_since = True, NEVER, now
            self.outputs_off_line()
            self.analogue = [self.parameter(66), self.parameter(67)]
        if now >= self.overflow_end:
            self.overflow_end = NEVER
            self.over("receive-overflow")
            self.over("transmit-overflow")
        self.watch()
        self.poll()
        # Outputs that an error has just moved are seen by the inputs.
        self.digital_inputs()

    def watch(self):
        """Objects that are sent when they change and have no rules of their own."""
        for index in (0x1001, 0x3001, 0x3004, 0x3005, 0x4007):
            self.on_read(index, 0)
            for sub in range(0 if index == 0x1001 else 1, 5):
                entry = self.od.get((index, sub))
                if entry and self.watched.get((index, sub)) != entry.value:
                    self.watched[index, sub] = entry.value
                    self.event((index, sub))

    def next_due(self):
        if not self.on:
            return NEVER
        times = [self.due(), self.now + 0.2, self.overflow_end, self.off_line_at] + self.ticks
        times += [one.next for one in self.inputs]
        if any(encoder.frequency for encoder in self.encoders):
            times.append(self.now + 0.01)
        needed = self.parameter(72) * 0.0005
        for block in (0, 1):
            waiting = self.seen[block] ^ self.level(block)
            times += [self.raw_since[block][bit] + needed
                      for bit in range(8) if waiting >> bit & 1]
        return min(times)

    def switch(self, on):
        """The supply."""
        if on and not self.on:
            self.on = True
            self.power_on()
        elif not on:
            self.on = False
            self.forget()
            self.state = canopen.INITIALISING

    def power_on(self):
        # The boot-up time is a stored parameter.
        self[0x2000, 3] = (self.stored or {}).get((0x2000, 3), 120)
        self.start(True)

    # The bench

    def names(self):
        per_input = ["analogue-input", "input-voltage", "input-current", "input-temperature",
                     "input-potentiometer", "input-resistance", "input-wiring", "encoder-steps",
                     "encoder-frequency", "encoder-index", "encoder-lines", "input-led"]
        per_block = ["digital-inputs", "digital-outputs", "output-supply", "analogue-output",
                     "output-voltage", "output-current", "status-leds", "output-led"]
        return (["power", "supply-voltage", "communication-interface", "run-led", "com-led",
                 "display", "memory-fault", "terminal-fault", "bus-fault", "module-1",
                 "terminal-temperature"]
                + [f"{name}-{n}" for name in per_input for n in range(1, 5)]
                + [f"{name}-{n}" for name in per_block for n in range(1, 3)])

    def needs(self):
        """An input of 0 to 10 V that shows millivolts at once."""
        return {f"analogue-input-{n + 1}": {
            f"3000:{sub + n:02X}": value
            for sub, value in ((21, 17), (26, 0), (30, 10000), (54, 1), (85, 32767))
        } | {f"3000:{58 + n // 2:02X}": 13} for n in range(4)}

    def set(self, name, value):
        kind, _, n = name.rpartition("-")
        n = int(n) - 1 if n.isdigit() else 0
        if name == "power":
            self.bench[name] = value
            self.switch(value == "on")
        elif name == "communication-interface":
            # The app restarts the module after it has written (M 5.4).
            self.bench[name] = value
            self[0x3000, 1] = int(value == "rs485")
            self.stored = dict(self.stored or {}) | {(0x3000, 1): self[0x3000, 1]}
            if self.on:
                self.power_on()
        elif kind == "digital-inputs":
            self.levels[n] = value
        elif kind == "output-supply":
            self.supplies[n] = value
        elif kind == "analogue-input":
            self.bench[f"input-voltage-{n + 1}"] = float(value)
        elif kind == "encoder-steps":
            self.move(n, float(value))
        elif kind == "encoder-frequency":
            self.encoders[n].frequency = float(value)
        elif kind == "encoder-lines":
            self.encoders[n].lines = value
        elif kind == "encoder-index":
            rises = value and not self.encoders[n].index
            self.encoders[n].index = value
            if rises and self.on and self.parameter(73 + n) in (3, 4) and self[0x3003, n + 1] & 2:
                self.load_from(n)
        elif name in self.bench:
            self.bench[name] = value
            if self.on and self.state != canopen.INITIALISING:
                if name == "bus-fault":
                    self.bus_fault(value)
                elif name == "module-1":
                    self.module_fault()
        else:
            raise ValueError(f"the bench has no `{name}` that can be set")

    def bus_fault(self, value):
        """M 11.9. A buffer runs over once; how long that is an error is open."""
        faults = {"receive-overflow": (0x8110, 1), "transmit-overflow": (0x8110, 2),
                  "error-passive": (0x8120, 3)}
        for fault in faults:
            if fault != value:
                self.over(fault)
        if value in faults:
            code, number = faults[value]
            self.failed(value, code, 0x11, [0, number, 0, 0, 0])
            if code == 0x8110:
                self.overflow_end = self.now + 0.1
                self.on_communication_error()

    def module_fault(self):
        """M 11.9: the bus of the module, and its diagnosis, whose bytes are open."""
        value = self.bench["module-1"]
        for key, fault in (("module", "broken"), ("diagnosis", "faulty")):
            if value != fault:
                self.over(key)
        if value == "broken":
            self.failed("module", 0xFF00, 0x81, [0, 6, 1, 0, 0])
            self.enter(canopen.STOPPED)
        elif value == "faulty":
            self.failed("diagnosis", 0xFF00, 0x81, [1, 7, 1, 1, 1])

    def get(self, name):
        kind, _, n = name.rpartition("-")
        n = int(n) - 1 if n.isdigit() else 0
        seen = {
            "run-led": self.run_led,
            "com-led": lambda: int(self.on and self.now - self.spoken < 0.1),
            "display": self.display,
        }
        numbered = {
            "digital-inputs": lambda: self.levels[n], "output-supply": lambda: self.supplies[n],
            "digital-outputs": lambda: self.driven(n),
            "analogue-input": lambda: int(self.bench[f"input-voltage-{n + 1}"]),
            "encoder-steps": lambda: math.floor(self.encoders[n].steps),
            "encoder-frequency": lambda: self.encoders[n].frequency,
            "encoder-lines": lambda: self.encoders[n].lines,
            "encoder-index": lambda: self.encoders[n].index,
            "analogue-output": lambda: self.limited(n) if self.on else 0,
            "output-voltage": lambda: self.output(n, 0),
            "output-current": lambda: self.output(n, 1),
            "status-leds": lambda: self.level(n) if self.on else 0,
            "input-led": lambda: self.input_led(n),
            "output-led": lambda: int(self.on and self.share(n) > 0),
        }
        if name in self.bench:
            return self.bench[name]
        if name not in self.names():
            raise ValueError(f"the bench has no `{name}`")
        return seen[name]() if name in seen else numbered[kind]()

    def blinks(self, pattern):
        """Whether a LED that blinks is on: on and off in ms by turns."""
        place = (self.now - self.led_since) * 1000 % sum(pattern)
        for position, length in enumerate(pattern):
            if place < length:
                return int(position % 2 == 0)
            place -= length
        return 0

    def run_led(self):
        if not self.on:
            return 0
        emergency = bool(self.active)
        if self.modbus:
            pattern = BLINK_MEDIUM if self.off_line else LIT
        elif self.state == canopen.INITIALISING:
            pattern = BLINK_FAST
        elif self.state == canopen.OPERATIONAL:
            pattern = BLINK_3_ON if emergency else LIT
        elif self.state == canopen.STOPPED:
            pattern = BLINK_3_OFF if emergency else BLINK_1_OFF
        else:
            pattern = BLINK_MEDIUM if emergency else BLINK_SLOW
        return self.blinks(pattern)

    def input_led(self, n):
        if not self.on or not self.inputs[n].kind:
            return 0
        return self.blinks(BLINK_MEDIUM) if self.inputs[n].error else 1

    def display(self):
        """M 5.1 and 12."""
        if not self.on:
            return ""
        if self.state == canopen.INITIALISING and not self.modbus:
            return "1.00"
        first, second = self.flags()
        errors = [bit + 1 for bit in range(16) if first >> bit & 1]
        errors += [bit + 17 for bit in range(3) if second >> bit & 1]
        return f"E-{errors[0]:02d}" if errors else ""


class Program:
    """The module between standard input and output and the socket of its bench."""

    def __init__(self, node, path):
        self.module = Module(self.transmit, node)
        self.begin = time.monotonic()
        self.pending = b""
        self.listener, self.clients = None, {}
        if path:
            if os.path.exists(path):
                os.unlink(path)
            self.listener = socket.socket(socket.AF_UNIX)
            self.listener.bind(path)
            self.listener.listen()

    def transmit(self, identifier, data):
        stamp = time.monotonic() - self.begin
        line = f"({stamp:.6f}) can0 {identifier:03X}#{data.hex().upper()}\n"
        os.write(1, line.encode())

    def run(self):
        module = self.module
        module.now = time.monotonic()
        module.power_on()
        while True:
            wait = max(0.0, min(1.0, module.next_due() - time.monotonic()))
            sources = [0, *self.clients] + ([self.listener] if self.listener else [])
            ready, _, _ = select.select(sources, [], [], wait)
            module.advance(time.monotonic())
            for source in ready:
                if source == 0:
                    if not self.frames():
                        return
                elif source is self.listener:
                    self.clients[source.accept()[0]] = b""
                else:
                    self.requests(source)

    def frames(self):
        data = os.read(0, 65536)
        *lines, self.pending = (self.pending + data).split(b"\n")
        for line in lines:
            self.frame(line.decode())
        return bool(data)

    def frame(self, line):
        words = line.split()
        module = self.module
        if not words or line.startswith("#") or not module.on or module.mute:
            return
        identifier, _, data = words[-1].partition("#")
        if len(identifier) != 3:
            return                 # 29 bits: nobody here
        remote = data.startswith("R")
        module.receive(int(identifier, 16), b"" if remote else bytes.fromhex(data), remote)
        module.advance(time.monotonic())

    def requests(self, client):
        try:
            data = client.recv(65536)
        except ConnectionError:
            data = b""
        if not data:
            del self.clients[client]
            client.close()
            return
        *lines, self.clients[client] = (self.clients[client] + data).split(b"\n")
        for line in lines:
            try:
                answer = self.request(json.loads(line))
            except ValueError as error:
                answer = {"error": str(error)}
            client.sendall(json.dumps(answer).encode() + b"\n")

    def request(self, asked):
        module = self.module
        if "names" in asked:
            return {"names": module.names(), "needs": module.needs()}
        if "get" in asked:
            return {"value": module.get(asked["get"])}
        for name, value in asked["set"].items():
            module.set(name, value)
        module.advance(time.monotonic())
        return {"ok": True}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--node", type=int, default=1)
    parser.add_argument("--bench-socket")
    options = parser.parse_args()
    try:
        Program(options.node, options.bench_socket).run()
    except (BrokenPipeError, KeyboardInterrupt):
        sys.exit(0)


if __name__ == "__main__":
    main()
