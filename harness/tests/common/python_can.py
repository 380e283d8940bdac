"""A reference device on a bus of python-can.

BUS is its interface and channel, `virtual:bench`; DEVICE is the program that is the device on
pipes. A bus that ends at its process gets its device there: as `sitecustomize` this runs beside whatever
Python runs.
"""

import os
import subprocess
import sys
import threading


def to_bus(device, bus, can):
    for line in device.stdout:
        identifier, _, data = line.split()[-1].partition("#")
        remote = data.startswith("R")
        bus.send(
            can.Message(
                arbitration_id=int(identifier, 16),
                is_extended_id=len(identifier) == 8,
                is_remote_frame=remote,
                data=None if remote else bytes.fromhex(data),
            )
        )
        # Whoever started this waits for the device; beside another program, the output is its own.
        if __name__ == "__main__":
            print(line, flush=True)


def serve():
    import can

    interface, channel = os.environ["BUS"].split(":")
    bus = can.Bus(interface=interface, channel=channel)
    device = subprocess.Popen(
        os.environ["DEVICE"].split(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        bufsize=1,
    )
    threading.Thread(target=to_bus, args=(device, bus, can), daemon=True).start()
    for message in bus:
        identifier = format(message.arbitration_id, "08X" if message.is_extended_id else "03X")
        data = bytes(message.data).hex()
        if message.is_remote_frame:
            data = f"R{message.dlc}"
        device.stdin.write(f"(0.0) can0 {identifier}#{data}\n")
    device.stdin.close()


if __name__ == "__main__":
    serve()
elif "DEVICE" in os.environ:
    threading.Thread(target=serve, daemon=True).start()
