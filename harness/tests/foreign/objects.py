"""Prints what a device on vcan0 answers to an upload of each object of its data sheet.

    objects.py NODE SHEET

A server may give up a transfer in which this program pauses, so an upload that fails is repeated.
"""

import sys

import canopen
from canopen.sdo.exceptions import SdoError

INTERFACE = "vcan0"
TRIES = 5


def upload(sdo, index, subindex):
    for _ in range(TRIES):
        try:
            return sdo.upload(index, subindex).hex(" ")
        except SdoError as error:
            failure = error
    return str(failure)


def main(node, sheet):
    network = canopen.Network()
    network.connect(interface="socketcan", channel=INTERFACE)
    device = network.add_node(node, sheet)
    for entry in device.object_dictionary.values():
        is_variable = isinstance(entry, canopen.objectdictionary.ODVariable)
        for variable in [entry] if is_variable else entry.values():
            value = upload(device.sdo, variable.index, variable.subindex)
            print(f"{variable.index:04X}:{variable.subindex:02X} {value}")
    network.disconnect()


main(int(sys.argv[1]), sys.argv[2])
