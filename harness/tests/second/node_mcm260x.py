"""What any CANopen node has: dictionary, SDO server, NMT, error control, SYNC, PDOs, emergencies.

Written from public facts about CiA 301 and from the manual of the Pixsys MCM260X (clauses "M ..."),
for the device in `mcm260x_9ad.py`. Times are seconds of `time.monotonic`.
"""

import struct

INITIALISING, STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0, 4, 5, 127
NEVER = float("inf")

FORMATS = {"bool": "<B", "u8": "<B", "u16": "<H", "u32": "<I", "i16": "<h", "i32": "<i"}

# Abort codes of CiA 301.
TOGGLE, NO_COMMAND = 0x05030000, 0x05040001
UNSUPPORTED, READ_ONLY = 0x06010000, 0x06010002
NO_OBJECT, NO_SUB = 0x06020000, 0x06090011
NOT_MAPPABLE, TOO_MUCH_MAPPED, INCOMPATIBLE = 0x06040041, 0x06040042, 0x06040043
TOO_LONG, TOO_SHORT = 0x06070012, 0x06070013
INVALID, TOO_HIGH, TOO_LOW = 0x06090030, 0x06090031, 0x06090032
HARDWARE, CANNOT_STORE = 0x06060000, 0x08000020
NO_DATA = 0x08000024


QUEUE = 32     # emergencies that may wait


class Abort(Exception):
    """Why an access to the dictionary is refused: an abort code."""

    def __init__(self, code):
        super().__init__(hex(code))
        self.code = code


class Entry:
    """A sub-index: its type, access, limits, and value."""

    def __init__(self, kind, access, default, low, high, pdo, stored):
        self.kind, self.access, self.default = kind, access, default
        self.low, self.high, self.pdo, self.stored = low, high, pdo, stored
        self.value = default

    def size(self):
        return len(self.value) if self.kind == "text" else struct.calcsize(FORMATS[self.kind])

    def pack(self):
        if self.kind == "text":
            return self.value.encode()
        return struct.pack(FORMATS[self.kind], self.value)

    def unpack(self, data):
        return struct.unpack(FORMATS[self.kind], data)[0]


class Pdo:
    """What a PDO remembers beside its parameters."""

    def __init__(self):
        self.clear()

    def clear(self):
        self.pending = False       # an event waits to be sent
        self.free = 0.0            # end of the inhibit time
        self.timer = NEVER         # next event of the event timer
        self.syncs = 0             # SYNCs since the last transmission
        self.sampled = None        # data as of the last SYNC, type 252
        self.held = None           # received data that wait for a SYNC


class Node:
    """A node. A device fills `od` and overrides the methods whose names begin with `on_`."""

    def __init__(self, transmit, node_id):
        self.transmit = transmit   # of an identifier and data
        self.node_id = node_id
        self.od = {}
        self.now = 0.0
        self.state = INITIALISING
        self.stored = None
        self.boot_end = NEVER
        self.transfer = None
        self.tpdos = [Pdo() for _ in range(4)]
        self.rpdos = [Pdo() for _ in range(4)]
        self.forget()

    def forget(self):
        """What a reset of the communication ends."""
        self.transfer = None
        self.active = {}           # errors: register and additional code
        self.history = []          # 1003h, the newest first
        self.waiting = []          # emergencies that wait for the inhibit time
        self.emcy_free = 0.0
        self.heartbeat = NEVER
        self.toggle = 0
        self.guard_end = NEVER
        self.sync_end = NEVER
        self.consumers = {}        # node: end of its time, once it was heard
        for pdo in self.tpdos + self.rpdos:
            pdo.clear()

    # The dictionary

    def define(self, index, sub, kind, access, default, low=None, high=None, pdo="", stored=None):
        """Adds an entry. `pdo` is "t" or "r"; what can be written is stored unless said."""
        stored = access == "rw" and pdo == "" if stored is None else stored
        self.od[index, sub] = Entry(kind, access, default, low, high, pdo, stored)

    def __getitem__(self, key):
        return self.od[key].value

    def __setitem__(self, key, value):
        self.od[key].value = value

    def entry(self, index, sub):
        found = self.od.get((index, sub))
        if found is None:
            known = any(key[0] == index for key in self.od)
            raise Abort(NO_SUB if known else NO_OBJECT)
        return found

    def write(self, index, sub, data):
        """Writes what a client or a PDO brought."""
        entry = self.entry(index, sub)
        if entry.access != "rw":
            raise Abort(READ_ONLY)
        if len(data) != entry.size():
            raise Abort(TOO_LONG if len(data) > entry.size() else TOO_SHORT)
        value = entry.unpack(data)
        if entry.kind == "bool" and value > 1:
            raise Abort(INVALID)
        if entry.high is not None and value > entry.high:
            raise Abort(TOO_HIGH)
        if entry.low is not None and value < entry.low:
            raise Abort(TOO_LOW)
        before = entry.value
        self.check(index, sub, value)
        self.on_check(index, sub, value)
        entry.value = value
        self.apply(index, sub, before)
        self.on_write(index, sub, value)

    def check(self, index, sub, value):
        """Refuses what CiA 301 does not allow."""
        if index == 0x1003 and value != 0:
            raise Abort(INVALID)
        if index == 0x1010 and value != 0x65766173 or index == 0x1011 and value != 0x64616F6C:
            raise Abort(CANNOT_STORE)
        if index == 0x1016 and value >> 16 & 0xFF and value & 0xFFFF:
            for other in range(1, 5):
                twin = self[0x1016, other]
                if other != sub and twin & 0xFFFF and (twin ^ value) >> 16 & 0xFF == 0:
                    raise Abort(INCOMPATIBLE)
        if index & 0xFFFC in (0x1400, 0x1800):
            self.check_parameter(index, sub, value)
        if index & 0xFFFC in (0x1600, 0x1A00):
            self.check_mapping(index, sub, value)

    def check_parameter(self, index, sub, value):
        cob = self[index, 1]
        receives = index < 0x1800
        if sub == 1:
            if value >> 11 & 0x7FFFF:
                raise Abort(INVALID)
            if not value >> 31 and is_restricted(value & 0x7FF):
                raise Abort(INVALID)
            # The identifier may not change while the PDO exists.
            if not cob >> 31 and not value >> 31 and (cob ^ value) & 0x7FF:
                raise Abort(INVALID)
            # Without data there is no use for it, unless the device itself begins so.
            count = self.od[index + 0x200, 0]
            if cob >> 31 and not value >> 31 and count.default and not count.value:
                raise Abort(INVALID)
            # Nobody could ask for it.
            if value >> 30 == 1 and not receives and self[index, 2] in (252, 253):
                raise Abort(INVALID)
        if sub == 2 and (241 <= value <= 251 or receives and value == 252):
            raise Abort(INVALID)
        if sub == 3 and not cob >> 31:
            raise Abort(INVALID)

    def check_mapping(self, index, sub, value):
        if not self[index - 0x200, 1] >> 31:
            raise Abort(UNSUPPORTED)
        kind = "r" if index < 0x1A00 else "t"
        if sub:
            if self[index, 0]:
                raise Abort(UNSUPPORTED)
            if value:
                self.check_mapped(value, kind)
            return
        if value > 8:
            raise Abort(TOO_MUCH_MAPPED if value < 254 else INVALID)
        entries = [self[index, place] for place in range(1, value + 1)]
        if 0 in entries:
            raise Abort(INVALID)
        for mapped in entries:
            self.check_mapped(mapped, kind)
        if sum(mapped & 0xFF for mapped in entries) > 64:
            raise Abort(TOO_MUCH_MAPPED)

    def check_mapped(self, mapped, kind):
        entry = self.od.get((mapped >> 16, mapped >> 8 & 0xFF))
        if entry is None and mapped >> 16 >= 0x1000:
            self.entry(mapped >> 16, mapped >> 8 & 0xFF)
        if entry is None or kind not in entry.pdo or mapped & 0xFF != 8 * entry.size():
            raise Abort(NOT_MAPPABLE)

    def apply(self, index, sub, before):
        """What a write to the communication profile does."""
        value = self[index, sub]
        if index == 0x1003:
            # M 11.9: the first line of the table.
            self.history = []
            self.emergency(0, 0, bytes(5))
        elif index == 0x1010:
            self[index, sub] = before
            self.on_store()
        elif index == 0x1011:
            self[index, sub] = before
            self.stored = None
        elif index == 0x1006:
            if self.sync_end != NEVER:
                self.sync_end = self.now + self.sync_time() if value else NEVER
        elif index in (0x100C, 0x100D):
            life = self.life_time()
            self.guard_end = self.now + life if life and self.guard_end != NEVER else NEVER
        elif index == 0x1016:
            self.consumers.pop(before >> 16 & 0xFF, None)
            self.consumers.pop(value >> 16 & 0xFF, None)
            self.repaired(("heartbeat", before >> 16 & 0xFF))
        elif index == 0x1017:
            self.heartbeat = self.now + value / 1000 if value else NEVER
            if value:
                # M 11.7: either guarding or the heartbeat.
                self.guard_end = NEVER
        elif index & 0xFFFC == 0x1800:
            pdo = self.tpdos[index & 3]
            if sub != 3:
                pdo.clear()
            self.start_timer(index & 3)
        elif index & 0xFFFC == 0x1400:
            self.rpdos[index & 3].held = None

    def save(self):
        """1010h."""
        # A default that follows the node id goes on to follow it.
        self.stored = {key: entry.value for key, entry in self.od.items() if entry.stored
                       and not (callable(entry.default) and key[0] < 0x2000
                                and entry.value == entry.default(self.node_id))}

    def load(self, first, last):
        """Values as they are after a reset: stored ones, and defaults."""
        for key, entry in self.od.items():
            if first <= key[0] <= last and entry.access == "rw":
                default = entry.default(self.node_id) if callable(entry.default) else entry.default
                entry.value = (self.stored or {}).get(key, default)

    # NMT

    def start(self, application):
        """Begins to boot, after power-on or a reset."""
        self.forget()
        self.state = INITIALISING
        if application:
            self.on_node_id()
        self.load(0x1000, 0xFFFF if application else 0x1FFF)
        self.boot_end = self.now + self.on_boot_time()
        for (index, _), entry in self.od.items():
            if callable(entry.default) and entry.access != "rw":
                entry.value = entry.default(self.node_id)
        self.on_reset(application)

    def booted(self):
        self.boot_end = NEVER
        self.send(0x700 + self.node_id, b"\0")
        if self[0x1017, 0]:
            self.heartbeat = self.now + self[0x1017, 0] / 1000
        self.enter(self.on_booted())

    def enter(self, state):
        before, self.state = self.state, state
        if state != before and OPERATIONAL in (before, state):
            self.transitions_of_pdos(state == OPERATIONAL)
        if state == STOPPED:
            self.transfer = None
        self.on_state(before, state)

    def transitions_of_pdos(self, starts):
        if not starts:
            # M 11.6: monitoring is for OPERATIONAL.
            self.sync_end = NEVER
        for number, pdo in enumerate(self.tpdos):
            free = pdo.free
            pdo.clear()
            pdo.free = free
            # M 11.5: each is sent once with types 254 and 255.
            if starts:
                pdo.pending = self[0x1800 + number, 2] >= 254
                self.start_timer(number)
        for pdo in self.rpdos:
            pdo.held = None

    def command(self, data):
        if len(data) != 2 or data[1] not in (0, self.node_id):
            return
        states = {1: OPERATIONAL, 2: STOPPED, 128: PRE_OPERATIONAL}
        if data[0] in states:
            self.enter(states[data[0]])
        elif data[0] in (129, 130):
            self.start(data[0] == 129)

    # Frames

    def send(self, identifier, data):
        self.transmit(identifier, bytes(data))

    def receive(self, identifier, data, remote):
        """A frame with an identifier of 11 bits."""
        if self.state == INITIALISING:
            return
        if remote:
            self.requested(identifier)
        elif identifier == 0:
            self.command(data)
        elif identifier == 0x80:
            self.sync()
        elif identifier == 0x600 + self.node_id:
            if self.state != STOPPED and len(data) == 8:
                self.sdo(data)
        elif 0x701 <= identifier <= 0x77F and len(data) == 1 and data[0] & 0x7F in (4, 5, 127):
            self.heard(identifier - 0x700)
        elif self.state == OPERATIONAL:
            for number in range(4):
                cob = self[0x1400 + number, 1]
                if not cob >> 31 and cob & 0x7FF == identifier:
                    self.process_data(number, data)

    def requested(self, identifier):
        """A remote request."""
        if identifier == 0x700 + self.node_id:
            # M 11.7: either guarding or the heartbeat.
            if self[0x1017, 0]:
                return
            self.send(identifier, [self.toggle | self.state])
            self.toggle ^= 0x80
            if self.life_time():
                self.guard_end = self.now + self.life_time()
                self.repaired("guarding")
        elif self.state == OPERATIONAL:
            for number, pdo in enumerate(self.tpdos):
                cob = self[0x1800 + number, 1]
                kind = self[0x1800 + number, 2]
                # SYNC alone triggers the types 0 to 240.
                if cob & 0xC00007FF == identifier and self.mapped(0x1A00 + number) and kind > 240:
                    if kind >= 254:
                        pdo.pending = True
                    else:
                        self.send_pdo(number, pdo.sampled if kind == 252 else None)

    # SDO

    def sdo(self, data):
        kind, mux = data[0] >> 5, data[1:4]
        index, sub = mux[0] | mux[1] << 8, mux[2]
        try:
            if data[0] == 0x80:
                self.transfer = None
            elif kind == 1:
                self.transfer = None
                self.begin_download(index, sub, mux, data)
            elif kind == 2:
                self.transfer = None
                self.begin_upload(index, sub, mux)
            elif kind in (0, 3):
                mux = self.transfer["mux"] if self.transfer else bytes(3)
                if self.transfer is None or self.transfer["kind"] != kind:
                    raise Abort(NO_COMMAND)
                if data[0] >> 4 & 1 != self.transfer["toggle"]:
                    raise Abort(TOGGLE)
                self.segment(data)
            else:
                raise Abort(NO_COMMAND)
        except Abort as abort:
            self.transfer = None
            self.answer(b"\x80" + mux + struct.pack("<I", abort.code))

    def answer(self, data):
        self.send(0x580 + self.node_id, data.ljust(8, b"\0"))

    def begin_download(self, index, sub, mux, data):
        entry = self.entry(index, sub)
        if entry.access != "rw":
            raise Abort(READ_ONLY)
        expedited, sized = data[0] & 2, data[0] & 1
        if expedited:
            length = 4 - (data[0] >> 2 & 3) if sized else min(entry.size(), 4)
            self.write(index, sub, data[4:4 + length])
        else:
            size = struct.unpack("<I", data[4:])[0] if sized else None
            if sized and size != entry.size():
                raise Abort(TOO_LONG if size > entry.size() else TOO_SHORT)
            self.transfer = {"kind": 0, "mux": mux, "toggle": 0, "data": b"", "size": size,
                             "to": (index, sub)}
        self.answer(b"\x60" + mux)

    def begin_upload(self, index, sub, mux):
        entry = self.entry(index, sub)
        if index == 0x1003 and sub > len(self.history):
            raise Abort(NO_DATA)
        self.on_read(index, sub)
        self.on_upload()
        data = entry.pack()
        if len(data) <= 4:
            self.answer(bytes([0x43 | 4 - len(data) << 2]) + mux + data)
        else:
            self.transfer = {"kind": 3, "mux": mux, "toggle": 0, "data": data}
            self.answer(b"\x41" + mux + struct.pack("<I", len(data)))

    def segment(self, data):
        transfer = self.transfer
        toggle = transfer["toggle"]
        transfer["toggle"] ^= 1
        if transfer["kind"] == 3:
            part, transfer["data"] = transfer["data"][:7], transfer["data"][7:]
            last = not transfer["data"]
            self.answer(bytes([toggle << 4 | 7 - len(part) << 1 | last]) + part)
        else:
            transfer["data"] += data[1:8 - (data[0] >> 1 & 7)]
            last = data[0] & 1
            if len(transfer["data"]) > self.entry(*transfer["to"]).size():
                raise Abort(TOO_LONG)
            if last:
                self.write(*transfer["to"], transfer["data"])
            self.answer(bytes([0x20 | toggle << 4]))
        if last:
            self.transfer = None

    # Error control

    def life_time(self):
        return self[0x100C, 0] * self[0x100D, 0] / 1000

    def sync_time(self):
        # M 11.2.5: milliseconds, with a resolution of 2 ms.
        return (self[0x1006, 0] + 1) // 2 * 2 / 1000

    def heard(self, node):
        """A heartbeat of another node."""
        for sub in range(1, 5):
            value = self[0x1016, sub]
            if value >> 16 & 0xFF == node and value & 0xFFFF:
                self.consumers[node] = self.now + (value & 0xFFFF) / 1000
                self.repaired(("heartbeat", node))

    def emergency(self, code, register, extra):
        """Sends an emergency, unless the state forbids it; keeps an error in 1003h."""
        if code:
            # M 11.2.3: the code, and the first two bytes of what follows.
            self.history.insert(0, code | extra[0] << 16 | extra[1] << 24)
            del self.history[10:]
        if len(self.waiting) == QUEUE:
            # M 11.9: the queue overflows.
            code, register, extra = 0x5000, 0x81, b"\0\x09\0\0\0"
        if len(self.waiting) <= QUEUE:
            self.waiting.append(struct.pack("<HB", code, register) + extra)
        self.send_emergencies()

    def send_emergencies(self):
        speaks = self.state in (PRE_OPERATIONAL, OPERATIONAL)
        while speaks and self.waiting and self.now >= self.emcy_free:
            self.send(0x80 + self.node_id, self.waiting.pop(0))
            self.emcy_free = self.now + self[0x1015, 0] / 10000

    def failed(self, key, code, register, extra):
        """An error that lasts until it is repaired."""
        if key not in self.active:
            extra = bytes(extra)
            self.active[key] = register, extra
            self.emergency(code, register, extra)

    def repaired(self, key):
        """M 11.6 to 11.8: the emergency of before, with the code 0."""
        if key in self.active:
            register, extra = self.active.pop(key)
            self.emergency(0, register, extra)

    def over(self, key):
        """M 11.9, the first line: the end of an error that has no message of its own for it."""
        if self.active.pop(key, None):
            self.emergency(0, self.error_register(), bytes(5))

    def error_register(self):
        register = 0
        for one, _ in self.active.values():
            register |= one
        return register

    def lost(self, key, extra):
        """Guarding or a heartbeat did not come (M 11.7, 11.8)."""
        self.failed(key, 0x8130, 0x11, extra)
        self.on_communication_error()

    # PDO

    def mapped(self, index):
        return [(self[index, place] >> 16, self[index, place] >> 8 & 0xFF)
                for place in range(1, self[index, 0] + 1)]

    def process_data(self, number, data):
        mapped = self.mapped(0x1600 + number)
        length = sum(self.od[key].size() for key in mapped)
        if not length:
            return
        # M 11.9: too few bytes are discarded, of too many the first ones are used.
        extra = [length, len(data), number + 1]
        if len(data) >= length:
            self.over(("short", number))
        if len(data) <= length:
            self.over(("long", number))
        if len(data) < length:
            self.failed(("short", number), 0x8210, 0x81, [0, 5] + extra)
            return
        if len(data) > length:
            self.failed(("long", number), 0x8220, 0x81, [0, 6] + extra)
        if self[0x1400 + number, 2] <= 240:
            self.rpdos[number].held = data
        else:
            self.take(mapped, data)

    def take(self, mapped, data):
        for key in mapped:
            size = self.od[key].size()
            try:
                self.write(*key, data[:size])
            except Abort:
                pass
            data = data[size:]

    def sync(self):
        if self.state != OPERATIONAL:
            return
        if self[0x1006, 0]:
            self.sync_end = self.now + self.sync_time()
            self.repaired("sync")
        for number, pdo in enumerate(self.rpdos):
            if pdo.held is not None:
                held, pdo.held = pdo.held, None
                self.take(self.mapped(0x1600 + number), held)
        for number, pdo in enumerate(self.tpdos):
            kind = self[0x1800 + number, 2]
            if kind == 0 and pdo.pending:
                self.send_pdo(number)
            elif 1 <= kind <= 240:
                pdo.syncs += 1
                if pdo.syncs >= kind:
                    self.send_pdo(number)
            elif kind == 252:
                pdo.sampled = self.data_of(number)

    def data_of(self, number):
        mapped = self.mapped(0x1A00 + number)
        for key in mapped:
            self.on_read(*key)
        return b"".join(self.od[key].pack() for key in mapped)

    def send_pdo(self, number, data=None):
        pdo, index = self.tpdos[number], 0x1800 + number
        pdo.pending, pdo.syncs = False, 0
        if self[index, 1] >> 31 or not self[0x1A00 + number, 0]:
            return
        self.send(self[index, 1] & 0x7FF, self.data_of(number) if data is None else data)
        pdo.free = self.now + self[index, 3] / 10000     # M 11.1.1: 100 us
        self.start_timer(number)
        self.on_sent(self.mapped(0x1A00 + number))

    def start_timer(self, number):
        index = 0x1800 + number
        wanted = self.state == OPERATIONAL and self[index, 2] >= 254 and self[index, 5]
        self.tpdos[number].timer = self.now + self[index, 5] / 1000 if wanted else NEVER

    def event(self, key):
        """The value of an object that may be mapped has changed."""
        if self.state == OPERATIONAL:
            for number, pdo in enumerate(self.tpdos):
                if key in self.mapped(0x1A00 + number):
                    pdo.pending = True

    # Time

    def due(self):
        """When `poll` has something to do."""
        times = [self.boot_end, self.heartbeat, self.guard_end, self.sync_end]
        times += self.consumers.values()
        if self.waiting and self.state in (PRE_OPERATIONAL, OPERATIONAL):
            times.append(self.emcy_free)
        for number, pdo in enumerate(self.tpdos):
            if pdo.pending and self[0x1800 + number, 2] >= 254:
                times.append(pdo.free)
            times.append(pdo.timer)
        return min(times)

    def poll(self):
        """Does what is due."""
        now = self.now
        if now >= self.boot_end:
            self.booted()
        if now >= self.heartbeat:
            self.send(0x700 + self.node_id, [self.state])
            self.heartbeat = max(self.heartbeat + self[0x1017, 0] / 1000, now)
        if now >= self.guard_end:
            self.guard_end = NEVER
            self.lost("guarding", [0, 4, 0, 0, 0])
        if now >= self.sync_end:
            self.sync_end = NEVER
            self.failed("sync", 0x8100, 0x81, [0, 4, 0, 0, 0])
        for node in [node for node, end in self.consumers.items() if now >= end]:
            del self.consumers[node]
            self.lost(("heartbeat", node), [0, 5, node, 0, 0])
        self.send_emergencies()
        if self.state == OPERATIONAL:
            for number, pdo in enumerate(self.tpdos):
                if now >= pdo.timer:
                    pdo.pending = True
                    pdo.timer = NEVER
                if pdo.pending and self[0x1800 + number, 2] >= 254 and now >= pdo.free:
                    self.send_pdo(number)


def is_restricted(identifier):
    """Identifiers that CiA 301 keeps from PDOs."""
    ranges = [(0, 0x7F), (0x101, 0x180), (0x581, 0x5FF), (0x601, 0x67F), (0x6E0, 0x7FF)]
    return any(first <= identifier <= last for first, last in ranges)
