#!/usr/bin/env python3
"""A small master for a EUROMAP 66 device, and its partner: a simulated one, without a CAN interface.

    master.py [HARNESS]

HARNESS is the program, `harness` without it. The master starts the node, warms the medium by 5 K
and sees what the device reports when its safety limiter trips. The exit code is 0 when all came.
"""

import json
import os
import queue
import socket
import struct
import subprocess
import sys
import tempfile
import threading

NODE = 7
PATIENCE = 60.0

# Objects of the device, from `harness eds write em66`.
HEARTBEAT_TIME = (0x1017, 0)
PROCESS_VALUE = (0x7400, 1)
SET_POINT = (0x7402, 1)
CONTROL = (0x6425, 1)


class Partner:
    """The device, as a program that speaks lines of candump, and its bench."""

    def __init__(self, program, bench):
        command = [program, "serve", "em66", "--stdio", "--node", str(NODE)]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(
            command + ["--bench-socket", bench], stdin=pipe, stdout=pipe, text=True, bufsize=1)
        self.bench = bench
        self.received = {0x080 + NODE: queue.Queue(), 0x580 + NODE: queue.Queue(),
                         0x700 + NODE: queue.Queue()}
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        """Each line is `(seconds) interface id#data`."""
        for line in self.process.stdout:
            identifier, data = line.split()[-1].split("#")
            if int(identifier, 16) in self.received:
                self.received[int(identifier, 16)].put(bytes.fromhex(data))

    def send(self, identifier, data):
        """The time of a line that is sent need not be right."""
        self.process.stdin.write(f"(0.0) can0 {identifier:03X}#{data.hex().upper()}\n")
        self.process.stdin.flush()

    def receive(self, identifier):
        return self.received[identifier + NODE].get(timeout=PATIENCE)

    def stimulate(self, name, value):
        """The bench answers each line of JSON with one."""
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(self.bench)
            request = json.dumps({"set": {name: value}}, separators=(",", ":"))
            connection.sendall(request.encode() + b"\n")
            answer = connection.makefile().readline()
        if json.loads(answer) != {"ok": True}:
            raise RuntimeError(f"{name}: {answer.strip()}")


class Master:
    """NMT and expedited SDO transfers."""

    def __init__(self, partner):
        self.partner = partner

    def start(self):
        self.partner.send(0x000, bytes([1, NODE]))

    def transfer(self, request):
        self.partner.send(0x600 + NODE, request)
        answer = self.partner.receive(0x580)
        if answer[0] == 0x80:
            raise RuntimeError(f"SDO abort {struct.unpack('<I', answer[4:])[0]:08X}h")
        return answer

    def read(self, address, form):
        answer = self.transfer(struct.pack("<BHB4x", 0x40, *address))
        return struct.unpack_from("<" + form, answer, 4)[0]

    def write(self, address, form, value):
        data = struct.pack("<" + form, value)
        command = 0x23 | (4 - len(data)) << 2
        self.transfer(struct.pack("<BHB", command, *address) + data.ljust(4, b"\0"))


def main():
    program = sys.argv[1] if len(sys.argv) > 1 else "harness"
    with tempfile.TemporaryDirectory() as folder:
        partner = Partner(program, os.path.join(folder, "bench"))
        try:
            work(partner)
        finally:
            partner.process.stdin.close()
            partner.process.wait()


def work(partner):
    master = Master(partner)
    # What is sent before the boot-up message is not heard.
    assert partner.receive(0x700) == b"\0"
    master.write(HEARTBEAT_TIME, "H", 500)
    master.start()
    while partner.receive(0x700) != b"\5":
        pass
    print("the device is OPERATIONAL")

    begun = master.read(PROCESS_VALUE, "h")
    master.write(SET_POINT, "h", begun + 200)
    master.write(CONTROL, "B", 1)
    # Each heartbeat is a moment to look.
    while master.read(PROCESS_VALUE, "h") < begun + 50:
        partner.receive(0x700)
    print(f"the medium is 5 K warmer than {begun / 10} degrees")

    partner.stimulate("safety-limiter", 1)
    message = partner.receive(0x080)
    print(f"the device reports error {struct.unpack_from('<H', message)[0]:04X}h")


if __name__ == "__main__":
    main()
