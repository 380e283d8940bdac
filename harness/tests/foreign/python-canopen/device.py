"""A device made of python-canopen's LocalNode and its data sheet.

The stack holds the dictionary, answers SDO, follows NMT and sends the heartbeat. What it leaves to
the application is here: the boot-up and the reset of values when NMT asks for a reset, and when
PDOs are sent and taken over. BUS names another bus of python-can than vcan0.
"""

import os
import struct
import threading
from pathlib import Path

import canopen

NODE_ID = 3
INTERFACE, CHANNEL = os.environ.get("BUS", "socketcan:vcan0").split(":")
SHEET = Path(__file__).with_name("sheet.eds")
START, RESET_NODE, RESET_COMMUNICATION = 1, 129, 130
PDO_PARAMETERS = range(0x1400, 0x1C00)


class Device(canopen.LocalNode):
    def __init__(self):
        super().__init__(NODE_ID, str(SHEET))
        self.listening = []

    def boot(self):
        self.nmt.state = "INITIALISING"
        self.nmt.state = "PRE-OPERATIONAL"

    def on_nmt(self, _identifier, data, _timestamp):
        """Comes after the subscription that the stack has for itself."""
        command, addressed = struct.unpack_from("BB", data)
        if addressed not in (0, NODE_ID):
            return
        self.stop_pdos()
        if command == START:
            self.start_pdos()
        elif command in (RESET_NODE, RESET_COMMUNICATION):
            for index in list(self.data_store):
                if command == RESET_NODE or index < 0x2000:
                    del self.data_store[index]
            self.nmt.stop_heartbeat()
            self.boot()

    def set_data(self, index, subindex, data, check_writable=False):
        super().set_data(index, subindex, data, check_writable)
        if index in PDO_PARAMETERS and self.nmt.state == "OPERATIONAL":
            self.stop_pdos()
            self.start_pdos()

    def start_pdos(self):
        self.tpdo.read()
        self.rpdo.read()
        for pdo in self.tpdo.values():
            if pdo.enabled and pdo.map and pdo.event_timer:
                for variable in pdo:
                    variable.set_data(self.get_data(variable.index, variable.subindex))
                pdo.start(pdo.event_timer / 1000)
        for pdo in self.rpdo.values():
            if pdo.enabled:
                self.network.subscribe(pdo.cob_id, self.on_rpdo)
                self.listening.append(pdo.cob_id)

    def stop_pdos(self):
        for pdo in self.tpdo.values():
            pdo.stop()
        for identifier in self.listening:
            self.network.unsubscribe(identifier, self.on_rpdo)
        self.listening.clear()

    def on_rpdo(self, identifier, data, _timestamp):
        for pdo in self.rpdo.values():
            if pdo.enabled and pdo.cob_id == identifier and len(data) * 8 >= pdo.length:
                for variable in pdo:
                    start, end = variable.offset // 8, (variable.offset + variable.length) // 8
                    self.set_data(variable.index, variable.subindex, bytes(data[start:end]))


def main():
    network = canopen.Network()
    network.connect(interface=INTERFACE, channel=CHANNEL)
    device = Device()
    network.add_node(device)
    network.subscribe(0, device.on_nmt)
    device.boot()
    threading.Event().wait()


main()
