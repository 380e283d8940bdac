"""A device made of durand's MinimalNode, as its documentation shows it.

    device.py            serve it on vcan0 until it is stopped
    device.py --eds      print the data sheet that durand composes of its dictionary
"""

import asyncio
import sys

import can
from durand import Array, CANBusNetwork, DatatypeEnum, MinimalNode, Record, Variable

NODE_ID = 2
INTERFACE = "vcan0"


def objects(node):
    """What the application adds to the dictionary of the stack."""
    od = node.object_dictionary
    od.write(0x1018, 1, 0x7FFF_FFFF)
    od.write(0x1018, 2, 0x4455)
    od.write(0x1018, 3, 0x0001_0002)
    od.write(0x1018, 4, 2)
    od.write(0x1008, 0, b"durand")
    od.write(0x1009, 0, b"none")
    od.write(0x100A, 0, b"0.5.0")
    od[0x2000] = Variable(DatatypeEnum.UNSIGNED8, "rw", 5, minimum=1, maximum=200, name="Level")
    od[0x2001] = Variable(DatatypeEnum.INTEGER16, "rw", -3, name="Offset")
    od[0x2002] = Variable(DatatypeEnum.UNSIGNED32, "rw", 0x12345678, name="Counter")
    od[0x2003] = Variable(DatatypeEnum.VISIBLE_STRING, "rw", b"durand", name="Label")
    od[0x2004] = Variable(DatatypeEnum.REAL32, "rw", 1.5, name="Gain")
    od[0x2005] = Variable(DatatypeEnum.UNSIGNED16, "ro", 7, name="Reading")
    limits = Record(name="Limits")
    limits[1] = Variable(DatatypeEnum.INTEGER16, "rw", -100, name="Low")
    limits[2] = Variable(DatatypeEnum.INTEGER16, "rw", 100, name="High")
    od[0x2010] = limits
    od[0x2011] = Array(Variable(DatatypeEnum.UNSIGNED16, "rw", 0), 3, name="Points")


def mapping(node):
    node.tpdo[0].mapping = [(0x2005, 0), (0x2000, 0)]
    node.rpdo[0].mapping = [(0x2001, 0)]


class Silent:
    """A network with nobody on it."""

    def add_subscription(self, *_, **__):
        pass

    def send(self, *_):
        pass


async def serve():
    bus = can.Bus(interface="socketcan", channel=INTERFACE)
    network = CANBusNetwork(bus, asyncio.get_running_loop())
    node = MinimalNode(network, NODE_ID)
    objects(node)
    mapping(node)
    await asyncio.Event().wait()


if sys.argv[1:] == ["--eds"]:
    node = MinimalNode(Silent(), NODE_ID)
    objects(node)
    mapping(node)
    print(node.eds.content, end="")
else:
    asyncio.run(serve())
