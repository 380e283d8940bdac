"""A device in Python on pipes, with lines of candump.

The argument is its script, which takes the bus from BUS: one of python-can's that ends at its
process.
"""

import os
import runpy
import sys
import threading
import time

import can


def to_output(bus):
    for message in bus:
        identifier = format(message.arbitration_id, "08X" if message.is_extended_id else "03X")
        data = f"R{message.dlc}" if message.is_remote_frame else bytes(message.data).hex()
        print(f"({time.monotonic():.6f}) can0 {identifier}#{data}", flush=True)


def from_input(bus):
    for line in sys.stdin:
        identifier, _, data = line.split()[-1].partition("#")
        remote = data.startswith("R")
        bus.send(
            can.Message(
                arbitration_id=int(identifier, 16),
                is_extended_id=len(identifier) == 8,
                is_remote_frame=remote,
                dlc=int(data[1:] or 0) if remote else len(data) // 2,
                data=None if remote else bytes.fromhex(data),
            )
        )


interface, channel = os.environ["BUS"].split(":")
near = can.Bus(interface=interface, channel=channel)
for passes_on in (to_output, from_input):
    threading.Thread(target=passes_on, args=(near,), daemon=True).start()
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
