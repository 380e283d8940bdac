"""python-canopen as the master of every reference device and variant that the harness serves.

    master.py HARNESS [NAME...]

Each device is served on vcan0 and mastered with its own data sheet, as a machine builder would:
every object is read, every PDO is read and saved, a TPDO is asked for by SYNC, values go by block
transfer, a lost heartbeat is reported as emergency, what was stored survives a reset, and LSS finds
the device. Exit code 1 and a sentence when something does not hold.
"""

import logging
import subprocess
import sys
import threading
import time
from pathlib import Path

import canopen
from canopen.lss import LssError
from canopen.nmt import NmtError
from canopen.objectdictionary import DOMAIN, NUMBER_TYPES, ODVariable
from canopen.sdo.exceptions import SdoError

INTERFACE = "vcan0"
DEVICES = Path(__file__).parents[3] / "reference-devices"
SAVE, LOAD = int.from_bytes(b"save", "little"), int.from_bytes(b"load", "little")
HEARTBEAT_LOST = 0x8130
WATCHED = 0x7E
# Fastscan asks 128 times, and to half of the requests silence is the answer.
SCANNED = "generic"
# Block transfer is optional.
WITHOUT_BLOCKS = ("drr460", "mcm260x")
EXPECTED = (AssertionError, SdoError, NmtError, LssError)


def sheets():
    """The data sheet of each device and variant, by name."""
    found = {}
    for sheet in sorted(DEVICES.glob("*/device.eds")):
        found[sheet.parent.name] = sheet
    for sheet in sorted(DEVICES.glob("*/variants/*.eds")):
        found[f"{sheet.parents[1].name}-{sheet.stem}"] = sheet
    return found


def check(holds, sentence):
    if not holds:
        raise AssertionError(sentence)


def variables(dictionary):
    for thing in dictionary.values():
        yield from [thing] if isinstance(thing, ODVariable) else thing.values()


def named(variable):
    return f"{variable.index:04X}:{variable.subindex:02X}"


class Session:
    def __init__(self, network, name, sheet, process):
        self.name = name
        self.network = network
        self.process = process
        self.node = network.add_node(served_as(process), str(sheet))
        self.node.sdo.RESPONSE_TIMEOUT = 2.0
        self.dictionary = self.node.object_dictionary
        self.did = []
        self.booted = threading.Event()
        self.node.nmt.add_heartbeat_callback(self.on_heartbeat)

    def on_heartbeat(self, state):
        if state == 0:
            self.booted.set()

    def run(self):
        self.reset()
        self.reads_every_object()
        self.saves_every_pdo()
        self.receives_a_tpdo()
        self.transfers_blocks()
        self.hears_of_a_lost_heartbeat()
        self.stores_and_restores()
        self.is_found_by_lss()
        print(f"{self.name}: {', '.join(self.did)}")

    def reset(self):
        self.booted.clear()
        self.node.nmt.state = "RESET"
        check(self.booted.wait(5), "no boot-up message")

    def reads_every_object(self):
        count = 0
        for variable in variables(self.dictionary):
            dummy = variable.index < 0x1000
            history = variable.index == 0x1003 and variable.subindex > 0
            if not variable.readable or variable.data_type == DOMAIN or history or dummy:
                continue
            data = self.upload(variable)
            if variable.data_type in NUMBER_TYPES:
                check(len(data) * 8 == len(variable), f"{named(variable)} has {len(data)} bytes")
            if variable.default is not None and variable.access_type != "ro":
                value = variable.decode_raw(data)
                # A REAL32 is nearest to the number that the data sheet writes.
                default = variable.decode_raw(variable.encode_raw(variable.default))
                check(value == default, f"{named(variable)} is {value!r}")
            count += 1
        self.did.append(f"{count} objects read")

    def upload(self, variable):
        try:
            return self.node.sdo.upload(variable.index, variable.subindex)
        except SdoError as error:
            raise AssertionError(f"{named(variable)} is not read: {error}") from error

    def saves_every_pdo(self):
        count = 0
        for pdos in (self.node.tpdo, self.node.rpdo):
            pdos.read()
            before = {number: parameters(pdo) for number, pdo in pdos.items()}
            pdos.save()
            pdos.read()
            for number, pdo in pdos.items():
                check(parameters(pdo) == before[number], f"{pdo.com_record.od.name} changed")
                count += 1
        self.did.append(f"{count} PDOs saved")

    def receives_a_tpdo(self):
        pdo = next((pdo for pdo in self.node.tpdo.values() if pdo.enabled and pdo.map), None)
        if pdo is None or not pdo.com_record[2].od.writable:
            return
        pdo.trans_type = 1
        pdo.save()
        self.node.nmt.state = "OPERATIONAL"
        self.network.sync.start(0.02)
        check(pdo.wait_for_reception(2) is not None, "no TPDO with SYNC")
        self.network.sync.stop()
        self.did.append("TPDO with SYNC")
        self.reset()

    def transfers_blocks(self):
        if self.name.startswith(WITHOUT_BLOCKS):
            return
        texts = [v for v in variables(self.dictionary) if v.index == 0x1008]
        for variable in texts:
            plain = self.node.sdo.upload(variable.index, variable.subindex)
            block = self.node.sdo[variable.index].open("rb", block_transfer=True).read()
            check(block == plain, f"{named(variable)} by block is {block!r}, else {plain!r}")
            self.did.append("block upload")
        domains = [v for v in variables(self.dictionary) if v.data_type == DOMAIN and v.writable]
        for variable in domains[:1]:
            data = bytes(range(256)) * 4
            channel = self.node.sdo[variable.index]
            channel = channel if isinstance(self.dictionary[variable.index], ODVariable) else (
                channel[variable.subindex])
            with channel.open("wb", size=len(data), block_transfer=True) as stream:
                stream.write(data)
            came = self.node.sdo.upload(variable.index, variable.subindex)
            check(came == data, f"{named(variable)} has {len(came)} bytes, {len(data)} written")
            self.did.append("block download")

    def hears_of_a_lost_heartbeat(self):
        if 0x1016 not in self.dictionary or 0x1014 not in self.dictionary:
            return
        entry = self.node.sdo[0x1016][1]
        entry.raw = WATCHED << 16 | 100
        self.network.send_message(0x700 + WATCHED, [5])
        emergency = self.node.emcy.wait(HEARTBEAT_LOST, timeout=2)
        check(emergency is not None, "no emergency for a lost heartbeat")
        check(self.node.sdo[0x1001].raw & 1, "1001h shows no error with the emergency")
        entry.raw = 0
        self.did.append("emergency")
        self.reset()

    def stores_and_restores(self):
        if 0x1010 not in self.dictionary or 0x1011 not in self.dictionary:
            return
        heartbeat = self.node.sdo[0x1017]
        default = heartbeat.raw
        heartbeat.raw = default + 1000
        self.node.sdo[0x1010][1].raw = SAVE
        self.reset()
        check(heartbeat.raw == default + 1000, f"1017h was stored and is {heartbeat.raw}")
        self.node.sdo[0x1011][1].raw = LOAD
        self.reset()
        check(heartbeat.raw == default, f"1017h was restored and is {heartbeat.raw}")
        self.did.append("store and restore")

    def is_found_by_lss(self):
        if not self.dictionary.device_information.LSS_supported:
            return
        identity = [self.node.sdo[0x1018][sub].raw for sub in (1, 2, 3, 4)]
        lss = self.network.lss
        check(lss.send_switch_state_selective(*identity), "LSS does not select the device")
        check(lss.inquire_node_id() == self.node.id, "LSS says another node id")
        lss.configure_node_id(self.node.id)
        self.did.append("LSS")
        if self.name == SCANNED:
            self.is_found_by_fastscan(lss, identity)
        else:
            lss.send_switch_state_global(lss.WAITING_STATE)

    def is_found_by_fastscan(self, lss, identity):
        lss.configure_node_id(0xFF)
        lss.send_switch_state_global(lss.WAITING_STATE)
        self.node.nmt.state = "RESET COMMUNICATION"
        # A node without an id announces itself to nobody.
        time.sleep(0.2)
        lss.RESPONSE_TIMEOUT = 0.2
        found, scanned = lss.fast_scan()
        check(found and list(scanned) == identity, f"fastscan found {scanned}, not {identity}")
        lss.configure_node_id(self.node.id)
        self.booted.clear()
        lss.send_switch_state_global(lss.WAITING_STATE)
        check(self.booted.wait(5), "no boot-up message with the new node id")
        self.did.append("fastscan")


def parameters(pdo):
    mapped = [(variable.index, variable.subindex, variable.length) for variable in pdo.map]
    return pdo.cob_id, pdo.enabled, pdo.rtr_allowed, pdo.trans_type, mapped


def served_as(process):
    """The node id, which the first line of `harness serve` says."""
    line = process.stderr.readline().split()
    return int(line[line.index("node") + 1])


def master(harness, name, sheet):
    """Whether all held for the device."""
    command = [harness, "serve", name, "--target", INTERFACE]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    network = canopen.Network()
    network.connect(interface="socketcan", channel=INTERFACE)
    session = Session(network, name, sheet, process)
    try:
        session.run()
        return True
    except EXPECTED as error:
        print(f"{name}: {', '.join(session.did)}; then {type(error).__name__}: {error}")
        return False
    finally:
        network.disconnect()
        process.terminate()
        process.wait(10)


def main():
    logging.basicConfig(level=logging.ERROR)
    harness, *names = sys.argv[1:]
    all_sheets = sheets()
    good = [master(harness, name, all_sheets[name]) for name in names or all_sheets]
    sys.exit(0 if all(good) else 1)


main()
