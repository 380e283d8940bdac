"""A reference device on a bus of python-can.

BUS is its interface and channel, `virtual:bench`; DEVICE is the program that is the device on
pipes. FAULT and AFTER spoil the bus `virtual` of a bridge. A bus that ends at its process gets its device there: as `sitecustomize` this runs beside whatever
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


def spoil(fault, after):
    """What the bridge sends after that many frames meets a fault. It sends in the main thread."""
    import can
    from can.interfaces.virtual import VirtualBus

    send, left = VirtualBus.send, after

    def spoilt(bus, message, timeout=None):
        nonlocal left
        if threading.current_thread() is threading.main_thread():
            left -= 1
            if left < 0:
                if fault == "killed":
                    os._exit(9)
                raise OSError("no such device") if fault == "gone" else can.CanOperationError("full")
        send(bus, message, timeout)

    VirtualBus.send = spoilt


if "FAULT" in os.environ:
    spoil(os.environ["FAULT"], int(os.environ["AFTER"]))
if __name__ == "__main__":
    serve()
elif "DEVICE" in os.environ:
    threading.Thread(target=serve, daemon=True).start()
