"""What any CANopen node has, as far as the DRR460's manual asks for it: NMT, SDO (expedited and in
segments), heartbeat, guarding, SYNC, PDOs with mapping, emergencies, store and restore.

Written from the manual of the Pixsys DRR460-12A-CAN ("manual" below) and public facts about
CiA 301 alone. Times are seconds of a monotonic clock. Nothing here reads a clock or does I/O.
"""

import struct

BOOT, STOPPED, OPERATIONAL, PRE = 0, 4, 5, 127

FORMATS = {"bool": "<B", "u8": "<B", "i16": "<h", "u16": "<H", "u32": "<I"}

TOGGLE, COMMAND, NO_ACCESS = 0x05030000, 0x05040001, 0x06010000
READ_ONLY, NO_OBJECT, NO_MAPPING = 0x06010002, 0x06020000, 0x06040041
PDO_LENGTH, INCOMPATIBLE, HARDWARE = 0x06040042, 0x06040043, 0x06060000
LENGTH, TOO_LONG, TOO_SHORT, NO_SUB = 0x06070010, 0x06070012, 0x06070013, 0x06090011
VALUE, TOO_HIGH, TOO_LOW = 0x06090030, 0x06090031, 0x06090032
NO_STORE, STATE, NO_DATA = 0x08000020, 0x08000022, 0x08000024

SAVE, LOAD = 0x65766173, 0x64616F6C


class Abort(Exception):
    """An SDO abort with its code."""

    def __init__(self, code):
        super().__init__(hex(code))
        self.code = code


class Entry:
    """An entry of the dictionary: type, access, limits, default and use in PDOs (a set of r, t)."""

    def __init__(self, kind, access, default=0, low=None, high=None, pdo="", stored=True):
        self.kind, self.access, self.default = kind, access, default
        self.low, self.high, self.pdo = low, high, pdo
        self.stored = stored and access == "rw"
        self.value = default

    def size(self):
        return struct.calcsize(FORMATS[self.kind])

    def pack(self, value):
        if self.kind == "str":
            return value.encode()
        return struct.pack(FORMATS[self.kind], value)

    def unpack(self, data):
        if len(data) != self.size():
            raise Abort(TOO_LONG if len(data) > self.size() else TOO_SHORT)
        return struct.unpack(FORMATS[self.kind], data)[0]

    def check(self, value):
        if self.high is not None and value > self.high:
            raise Abort(TOO_HIGH)
        if self.low is not None and value < self.low:
            raise Abort(TOO_LOW)


class Pdo:
    """What a PDO remembers between frames."""

    def __init__(self, number, communication, mapping):
        self.number, self.communication, self.mapping = number, communication, mapping
        self.clear()

    def clear(self):
        self.held = None  # received, applied at the next SYNC
        self.sent = {}  # by object: the values sent last
        self.sampled = None  # read at SYNC, for type 252
        self.wanted = False  # an event waits for the inhibit time or the SYNC
        self.count = 0  # SYNCs since the last transmission
        self.inhibited = 0.0
        self.due = None  # when the event timer elapses


class Node:
    """A node. The device derives from it, and fills `self.od` before `power_on`."""

    RPDOS, TPDOS = 2, 4

    def __init__(self, send):
        self.emit = send  # (identifier, data) -> None
        self.od = {}
        self.node = 0
        self.state = None  # None: without power
        self.now = 0.0
        self.saved = None  # what 1010h stored
        self.rpdos = [Pdo(n + 1, 0x1400 + n, 0x1600 + n) for n in range(self.RPDOS)]
        self.tpdos = [Pdo(n + 1, 0x1800 + n, 0x1A00 + n) for n in range(self.TPDOS)]
        self.boots_at = None
        self.clear_communication()

    # ---- Hooks of the device ----

    def read(self, index, sub):
        return self.od[index, sub].value

    def refuse(self, index, sub, value):
        """Raises Abort where the device does not take the value now."""

    def written(self, index, sub, value, before):
        """After a value was taken in the place of another one."""

    def boot_time(self):
        return 0.0

    def state_after_boot(self):
        return PRE

    def application_reset(self):
        """Reset node: the application begins again."""

    def communication_error(self):
        """Guarding or a heartbeat failed."""

    def heard(self):
        """A frame for this node arrived."""

    def store_fails(self):
        return False

    # ---- Start and resets ----

    def clear_communication(self):
        self.toggle, self.life_due, self.heartbeat_due = 0, None, None
        self.monitored = {}  # by node: [when it is late, whether it was]
        self.sync_due, self.transfer = None, None
        self.queue, self.overflow, self.emcy_free = [], False, 0.0
        self.errors, self.history = {}, []
        for pdo in self.rpdos + self.tpdos:
            pdo.clear()

    def load(self, first, last):
        for (index, sub), entry in self.od.items():
            if first <= index <= last:
                entry.value = self.default(index, sub, entry)
                if entry.stored and self.saved is not None:
                    entry.value = self.saved.get((index, sub), entry.value)

    def default(self, index, sub, entry):
        return entry.default(self.node) if callable(entry.default) else entry.default

    def reset(self, application):
        """Reset node or reset communication: what was stored is valid again (CiA 301)."""
        kept = {key: of for key, of in self.errors.items() if not isinstance(key, tuple)}
        self.clear_communication()
        if not application:
            self.errors = kept  # those of the application go on
        self.load(0x1000, 0x1FFF)
        if application:
            self.load(0x2000, 0xFFFF)
        # One functionality under two indices, with the value of the one that is reset (11.4.15).
        self.od[0x67FE, 1].value = self.od[0x1029, 1].value
        self.state = BOOT
        self.boots_at = self.now + self.boot_time()
        if application:
            self.application_reset()

    def booted(self):
        self.boots_at = None
        self.emit(0x700 + self.node, b"\0")
        self.start_heartbeat()
        if self.state_after_boot() != BOOT:
            self.enter(self.state_after_boot())

    def enter(self, state):
        if state == self.state:
            return
        self.state = state
        self.transfer = None if state == STOPPED else self.transfer
        self.sync_due = None  # monitored in OPERATIONAL alone (manual 11.6)
        for pdo in self.rpdos + self.tpdos:
            pdo.held, pdo.wanted, pdo.count, pdo.due, pdo.sampled = None, False, 0, None, None
        if state == OPERATIONAL:
            for pdo in self.tpdos:
                # Types 254 and 255 are sent once (manual 11.5).
                pdo.sent = {m: self.read(*m) for m in self.mapped(pdo)}
                if self.kind(pdo) >= 254:
                    pdo.inhibited = 0.0
                    self.trigger(pdo)
        self.flush_emergencies()

    # ---- Frames ----

    def frame(self, identifier, data, remote):
        if self.state is None or self.boots_at is not None:
            return
        if remote:
            return self.requested(identifier)
        if identifier == 0:
            return self.nmt(data)
        if self.state == BOOT:
            return
        if 0x700 < identifier < 0x780:
            self.heartbeat_of(identifier - 0x700, data)
        elif self.state == STOPPED:
            return
        elif identifier == 0x600 + self.node:
            if len(data) == 8:
                self.heard()
                self.sdo(data)
        elif identifier == self.od[0x1005, 0].value & 0x7FF:
            self.sync()
        elif self.state == OPERATIONAL:
            for pdo in self.rpdos:
                if identifier == self.od[pdo.communication, 1].value & 0x7FF and self.valid(pdo):
                    self.heard()
                    self.received(pdo, data)

    def nmt(self, data):
        if len(data) != 2 or data[1] not in (0, self.node):
            return
        targets = {1: OPERATIONAL, 2: STOPPED, 128: PRE}
        if data[0] in targets or data[0] in (129, 130):
            self.heard()
        if data[0] in targets:
            self.enter(targets[data[0]])
        elif data[0] in (129, 130):
            self.reset(data[0] == 129)

    def requested(self, identifier):
        if identifier == 0x700 + self.node:
            # Heartbeat or guarding, not both (manual 11.7, 11.8).
            if self.state == BOOT or self.od[0x1017, 0].value:
                return
            self.heard()
            self.emit(identifier, bytes([self.state | self.toggle]))
            self.toggle ^= 0x80
            life = self.od[0x100C, 0].value * self.od[0x100D, 0].value / 1000
            self.life_due = self.now + life if life else None
            self.clear_error(("guarding",), 0x11, b"\0\4\0\0\0")
        elif self.state == OPERATIONAL:
            for pdo in self.tpdos:
                cob = self.od[pdo.communication, 1].value
                if identifier == cob & 0x7FF and not cob >> 30 and self.mapped(pdo):
                    self.heard()
                    self.polled(pdo)

    # ---- Error control ----

    def start_heartbeat(self):
        time = self.od[0x1017, 0].value / 1000
        self.heartbeat_due = self.now + time if time else None

    def consumers(self):
        """The monitored nodes and their times, in seconds."""
        for sub in range(1, self.od[0x1016, 0].value + 1):
            value = self.od[0x1016, sub].value
            if value & 0xFFFF and 1 <= value >> 16 & 0xFF <= 127:
                yield value >> 16 & 0xFF, (value & 0xFFFF) / 1000

    def heartbeat_of(self, node, data):
        for other, time in self.consumers():
            # A boot-up message is no heartbeat (manual 11.8: from the first heartbeat on).
            if other == node and len(data) == 1 and data[0] & 0x7F:
                self.monitored[node] = self.now + time
                self.clear_error(("heartbeat", node), 0x11, bytes([0, 5, node, 0, 0]))

    def failed(self):
        """The state after a communication error (manual 11.7, 11.8; 67FEh)."""
        self.communication_error()
        action = self.od[0x67FE, 1].value
        if action == 2:
            self.enter(STOPPED)
        elif action == 0 and self.state == OPERATIONAL:
            self.enter(PRE)

    # ---- Emergencies ----

    def register(self):
        value = 0
        for bits in self.errors.values():
            value |= bits
        return value

    def set_error(self, key, code, bits, info):
        """An error begins: 1001h, 1003h and an emergency message."""
        if key not in self.errors:
            self.errors[key] = bits
            self.emergency(code, bits, info)

    def clear_error(self, key, bits, info):
        """An error ends. Its message repeats the register of the error (manual 11.6 to 11.8)."""
        if self.errors.pop(key, None) is not None:
            self.emergency(0, bits, info)

    def emergency(self, code, bits, info):
        if code:
            # The upper word is the first two bytes of the additional code (manual 11.2.3).
            self.history.insert(0, code | info[0] << 16 | info[1] << 24)
            del self.history[10:]
        if len(self.queue) >= 10:
            self.overflow = True
        else:
            register = 0 if bits is None else bits | self.register()
            self.queue.append(struct.pack("<HB", code, register) + info)
        self.flush_emergencies()

    def flush_emergencies(self):
        # None in STOPPED (CiA 301); they wait.
        while self.queue and self.state in (PRE, OPERATIONAL) and self.now >= self.emcy_free:
            self.emit(0x80 + self.node, self.queue.pop(0))
            self.emcy_free = self.now + self.od[0x1015, 0].value / 10000
            if self.overflow and not self.queue:
                self.overflow = False
                self.emergency(0x5000, 0x81, b"\0\x09\0\0\0")

    # ---- SYNC and PDOs ----

    def valid(self, pdo):
        return not self.od[pdo.communication, 1].value >> 31

    def kind(self, pdo):
        return self.od[pdo.communication, 2].value

    def mapped(self, pdo):
        """The objects of a PDO."""
        count = self.od[pdo.mapping, 0].value
        entries = [self.od[pdo.mapping, sub].value for sub in range(1, count + 1)]
        return [(entry >> 16, entry >> 8 & 0xFF) for entry in entries]

    def sync(self):
        period = self.od[0x1006, 0].value
        if self.state != OPERATIONAL:
            return
        if period:
            # In ms, in steps of 2 ms (manual 11.2.5).
            self.sync_due = self.now + (period + 1) // 2 * 2 / 1000
        self.clear_error(("sync",), 0x81, b"\0\4\0\0\0")
        for pdo in self.rpdos:
            if pdo.held is not None:
                held, pdo.held = pdo.held, None
                self.apply(pdo, held)
        for pdo in self.tpdos:
            if not self.valid(pdo) or not self.mapped(pdo):
                continue
            kind, pdo.count = self.kind(pdo), pdo.count + 1
            if (kind == 0 and pdo.wanted) or (1 <= kind <= 240 and pdo.count >= kind):
                pdo.count = 0
                self.transmit(pdo)
            elif kind == 252:
                pdo.sampled = self.content(pdo)

    def content(self, pdo):
        return b"".join(self.od[m].pack(self.read(*m)) for m in self.mapped(pdo))

    def transmit(self, pdo, data=None):
        pdo.wanted = False
        pdo.sent = {m: self.read(*m) for m in self.mapped(pdo)}
        self.emit(self.od[pdo.communication, 1].value & 0x7FF,
                  self.content(pdo) if data is None else data)
        pdo.inhibited = self.now + self.od[pdo.communication, 3].value / 10000
        timer = self.od[pdo.communication, 5].value / 1000
        pdo.due = self.now + timer if timer and self.kind(pdo) >= 254 else None

    def trigger(self, pdo):
        """An event of a TPDO."""
        if self.state != OPERATIONAL or not self.valid(pdo) or not self.mapped(pdo):
            return
        pdo.wanted = True
        if self.kind(pdo) >= 253 and self.now >= pdo.inhibited:
            self.transmit(pdo)

    def polled(self, pdo):
        """A remote request: types 252 to 255 (manual 11.2.21, 11.1.1)."""
        if self.kind(pdo) == 252:
            self.transmit(pdo, pdo.sampled)
        elif self.kind(pdo) >= 253:
            self.trigger(pdo)

    def analogue_event(self, channel, value, sent):
        """Whether a change of an analogue input is transmitted (manual 11.4.6 to 11.4.12)."""
        def of(index):
            return self.od[index, channel].value
        trigger, change = of(0x6421), value - sent
        if not self.od[0x6423, 0].value or not trigger or not change:
            return False
        inside = trigger & 1 and value >= of(0x6424) or trigger & 2 and value <= of(0x6425)
        moved = (trigger & 4 and abs(change) > of(0x6426) or trigger & 8 and -change > of(0x6427)
                 or trigger & 16 and change > of(0x6428))
        return bool((inside or not trigger & 3) and (moved or not trigger & 28))

    def watch_inputs(self):
        """Triggers the TPDOs whose objects have changed."""
        if self.state != OPERATIONAL:
            return
        for pdo in self.tpdos:
            if pdo.wanted or self.kind(pdo) not in (0, 254, 255):
                continue
            for mux in self.mapped(pdo):
                value, sent = self.read(*mux), pdo.sent.get(mux, 0)
                if mux[0] == 0x6401:
                    event = self.analogue_event(mux[1], value, sent)
                else:
                    event = value != sent
                if event:
                    self.trigger(pdo)
                    break

    def received(self, pdo, data):
        length = sum(self.od[m].size() for m in self.mapped(pdo))
        if not length:
            return
        # Either error lasts until a frame that does not have it (CiA 301: reported once).
        short, long = ("short", pdo.number), ("long", pdo.number)
        if len(data) >= length:
            self.clear_error(short, 0, bytes(5))
        if len(data) <= length:
            self.clear_error(long, 0, bytes(5))
        if len(data) < length:
            info = bytes([0, 5, length, len(data), pdo.number])
            return self.set_error(short, 0x8210, 0x81, info)
        if len(data) > length:
            info = bytes([0, 6, length, len(data), pdo.number])
            self.set_error(long, 0x8220, 0x81, info)
        if self.kind(pdo) <= 240:
            pdo.held = data[:length]
        else:
            self.apply(pdo, data[:length])

    def apply(self, pdo, data):
        for mux in self.mapped(pdo):
            entry = self.od[mux]
            value, data = entry.unpack(data[:entry.size()]), data[entry.size():]
            try:
                self.take(*mux, value)
            except Abort:
                pass  # what cannot be taken is left

    # ---- The dictionary ----

    def find(self, index, sub):
        if (index, sub) in self.od:
            return self.od[index, sub]
        raise Abort(NO_SUB if (index, 0) in self.od else NO_OBJECT)

    def upload(self, index, sub):
        entry = self.find(index, sub)
        if index == 0x1003:
            if sub > len(self.history):
                raise Abort(NO_DATA)
            return entry.pack(self.history[sub - 1] if sub else len(self.history))
        if index == 0x1001:
            return entry.pack(self.register())
        return entry.pack(self.read(index, sub))

    def take(self, index, sub, value):
        entry = self.od[index, sub]
        entry.check(value)
        if 0x1400 <= index <= 0x1BFF:
            self.check_pdo(index, sub, value)
        elif index == 0x1003 and value:
            raise Abort(VALUE)
        elif index == 0x1016:
            self.check_consumer(sub, value)
        self.refuse(index, sub, value)
        if index in (0x1010, 0x1011):
            return self.command(index, value)
        before, entry.value = entry.value, value
        if index == 0x1003:
            self.history = []
            # Manual 11.9, first line of the table: register 00h, whatever is present.
            self.emergency(0, None, bytes(5))
        elif index == 0x1017:
            self.start_heartbeat()
            self.life_due = None if value else self.life_due
        elif index == 0x1016:
            nodes = dict(self.consumers())
            self.monitored = {n: due for n, due in self.monitored.items() if n in nodes}
        elif index in (0x1029, 0x67FE):
            # One functionality under two indices (manual 11.4.15).
            self.od[0x1029, 1].value = self.od[0x67FE, 1].value = value
        elif index == 0x1006:
            self.sync_due = None
        elif index in (0x100C, 0x100D):
            self.life_due = None
        elif 0x1800 <= index <= 0x1803 and sub == 5:
            self.tpdos[index & 3].due = None
            if value and self.state == OPERATIONAL and self.kind(self.tpdos[index & 3]) >= 254:
                self.tpdos[index & 3].due = self.now + value / 1000
        self.written(index, sub, value, before)

    def command(self, index, value):
        if value != (SAVE if index == 0x1010 else LOAD):
            raise Abort(NO_STORE)
        if self.store_fails():
            # Manual 11.9: flash error.
            self.emergency(0x5000, 0x81, b"\0\2\0\0\0")
            raise Abort(HARDWARE)
        if index == 0x1010:
            self.saved = {mux: e.value for mux, e in self.od.items() if e.stored}
        else:
            self.saved = None
        self.written(index, 1, value, None)

    def check_consumer(self, sub, value):
        node = value >> 16 & 0xFF
        others = (self.od[0x1016, s].value for s in range(1, 5) if s != sub)
        if value & 0xFFFF and node and any(o & 0xFFFF and o >> 16 & 0xFF == node for o in others):
            raise Abort(INCOMPATIBLE)

    def check_pdo(self, index, sub, value):
        if self.state == OPERATIONAL and (index & 0x0200 or sub == 1):
            # Identifiers and mapping change in PRE-OPERATIONAL (manual 11.1.3, 11.5.1).
            raise Abort(STATE)
        self.check_pdo_value(index, sub, value)

    def check_pdo_value(self, index, sub, value):
        communication = index & ~0x0200
        old = self.od[communication, 1].value
        if index & 0x0200:
            return self.check_mapping(index, sub, value, not old >> 31)
        if sub == 1:
            # Bits 29 to 11 are reserved (manual 11.2.19); restricted identifiers (CiA 301).
            number = value & 0x7FF
            free = (0x7F < number < 0x101 or 0x180 < number < 0x581 or number == 0x600
                    or 0x67F < number < 0x6E0 or number == 0x700)
            if value & 0x3FFFF800 or not value >> 31 and not free:
                raise Abort(VALUE)
            if not (value | old) >> 31 and number != old & 0x7FF:
                raise Abort(VALUE)
        elif sub == 2:
            # 241 to 251 are reserved; 252 is not for RPDOs (manual 11.2.19).
            if 241 <= value <= 251 or value == 252 and index < 0x1800:
                raise Abort(VALUE)
        elif sub == 3 and not old >> 31 and value != self.od[index, sub].value:
            raise Abort(STATE)

    def check_mapping(self, index, sub, value, is_valid):
        direction = "r" if index < 0x1800 else "t"
        if is_valid:
            raise Abort(STATE)
        if sub:
            if self.od[index, 0].value:
                raise Abort(NO_ACCESS)
            if value:
                self.check_mapped(value, direction)
            return
        if value > 8:
            raise Abort(PDO_LENGTH)
        entries = [self.od[index, s].value for s in range(1, value + 1)]
        for entry in entries:
            self.check_mapped(entry, direction)
        if sum(entry & 0xFF for entry in entries) > 64:
            raise Abort(PDO_LENGTH)

    def check_mapped(self, value, direction):
        entry = self.od.get((value >> 16, value >> 8 & 0xFF))
        if entry is None:
            raise Abort(NO_OBJECT)
        if direction not in entry.pdo or entry.size() * 8 != value & 0xFF:
            raise Abort(NO_MAPPING)

    # ---- SDO ----

    def sdo(self, data):
        command, mux = data[0], data[1:4]
        index, sub = mux[0] | mux[1] << 8, mux[2]
        kind = command >> 5
        try:
            if kind == 4:
                self.transfer = None
            elif kind == 2:
                self.transfer = None
                self.initiate_upload(mux, self.upload(index, sub))
            elif kind == 1:
                self.transfer = None
                self.initiate_download(command, mux, self.find(index, sub), data[4:])
            elif kind in (0, 3) and self.transfer and self.transfer["kind"] == kind:
                mux = self.transfer["mux"]
                self.segment(command, data[1:])
            else:
                # Blocks are not described in the manual.
                if kind in (0, 3):  # a segment has no multiplexer of its own
                    mux = self.transfer["mux"] if self.transfer else bytes(3)
                raise Abort(COMMAND)
        except Abort as abort:
            self.transfer = None
            self.answer(0x80, mux, struct.pack("<I", abort.code))

    def answer(self, command, mux, data=b""):
        self.emit(0x580 + self.node, bytes([command]) + mux + data.ljust(4, b"\0"))

    def initiate_upload(self, mux, data):
        if 0 < len(data) <= 4:
            return self.answer(0x43 | (4 - len(data)) << 2, mux, data)
        self.transfer = {"kind": 3, "mux": mux, "data": data, "toggle": 0}
        self.answer(0x41, mux, struct.pack("<I", len(data)))

    def initiate_download(self, command, mux, entry, data):
        if entry.access != "rw":
            raise Abort(READ_ONLY)
        size = struct.unpack("<I", data)[0] if command & 1 else None
        if command & 2:
            length = 4 - (command >> 2 & 3) if command & 1 else entry.size()
            self.download(mux, data[:length])
            return
        if size is not None and size != entry.size():
            raise Abort(TOO_LONG if size > entry.size() else TOO_SHORT)
        self.transfer = {"kind": 0, "mux": mux, "data": b"", "toggle": 0, "entry": entry}
        self.answer(0x60, mux)

    def download(self, mux, data):
        index, sub = mux[0] | mux[1] << 8, mux[2]
        self.take(index, sub, self.od[index, sub].unpack(data))
        self.answer(0x60, mux)
        self.after_download(index)

    def after_download(self, index):
        """After the answer: the device restarts when it was restored (manual 7.1)."""
        if index == 0x1011:
            self.reset(True)

    def segment(self, command, data):
        transfer = self.transfer
        if command >> 4 & 1 != transfer["toggle"]:
            raise Abort(TOGGLE)
        answer = transfer["toggle"] << 4
        transfer["toggle"] ^= 1
        if transfer["kind"] == 3:
            part, transfer["data"] = transfer["data"][:7], transfer["data"][7:]
            last = not transfer["data"]
            self.transfer = None if last else transfer
            answer |= (7 - len(part)) << 1 | last
            return self.emit(0x580 + self.node, bytes([answer]) + part.ljust(7, b"\0"))
        transfer["data"] += data[:7 - (command >> 1 & 7)]
        if len(transfer["data"]) > transfer["entry"].size():
            raise Abort(TOO_LONG)
        if command & 1:
            mux = transfer["mux"]
            index, sub = mux[0] | mux[1] << 8, mux[2]
            self.take(index, sub, transfer["entry"].unpack(transfer["data"]))
            self.transfer = None
        self.emit(0x580 + self.node, bytes([0x20 | answer]) + bytes(7))
        if command & 1:
            self.after_download(index)

    # ---- Time ----

    def tick(self):
        """Does what is due."""
        if self.state is None:
            return
        if self.boots_at is not None:
            if self.now >= self.boots_at:
                self.booted()
            return
        if self.heartbeat_due is not None and self.now >= self.heartbeat_due:
            self.emit(0x700 + self.node, bytes([self.state]))
            self.heartbeat_due = max(self.heartbeat_due + self.od[0x1017, 0].value / 1000, self.now)
        if self.life_due is not None and self.now >= self.life_due:
            self.life_due = None
            self.set_error(("guarding",), 0x8130, 0x11, b"\0\4\0\0\0")
            self.failed()
        for node, due in list(self.monitored.items()):
            if self.now >= due:
                del self.monitored[node]
                self.set_error(("heartbeat", node), 0x8130, 0x11, bytes([0, 5, node, 0, 0]))
                self.failed()
        if self.sync_due is not None and self.now >= self.sync_due:
            self.sync_due = None
            self.set_error(("sync",), 0x8100, 0x81, b"\0\4\0\0\0")
        for pdo in self.tpdos if self.state == OPERATIONAL else []:
            if pdo.due is not None and self.now >= pdo.due:
                pdo.due = None
                self.trigger(pdo)
            if pdo.wanted and self.kind(pdo) >= 253 and self.now >= pdo.inhibited:
                self.transmit(pdo)
        self.flush_emergencies()

    def next_due(self):
        """When `tick` has something to do next."""
        dues = [self.boots_at, self.heartbeat_due, self.life_due, self.sync_due]
        dues += list(self.monitored.values()) + [pdo.due for pdo in self.tpdos]
        dues += [pdo.inhibited for pdo in self.tpdos if pdo.wanted and self.kind(pdo) >= 253]
        dues += [self.emcy_free] if self.queue and self.state in (PRE, OPERATIONAL) else []
        return min((due for due in dues if due is not None), default=None)
