#!/usr/bin/env python3
"""A place without hardware: a reference device behind an adapter that is offered over TCP.

    bench.py PORT DEVICE [HARNESS]

PORT speaks Lawicel's protocol, as an adapter behind ser2net. PORT + 100 is the switch of the supply,
as labgrid's `simplerest` asks it: `/1` switches on, `/0` off, `/` tells. Without supply the device
is silent, and the adapter goes on.
"""

import http.server
import re
import socket
import socketserver
import subprocess
import sys
import threading

BELL, END = b"\a", b"\r"
# Small letters are of frames with 11 bits.
FRAME = re.compile(
    rb"([trTR])((?<=[tr])[0-9A-Fa-f]{3}|(?<=[TR])[0-9A-Fa-f]{8})(\d)([0-9A-Fa-f]*)"
)


class Bench:
    def __init__(self, command):
        self.command = command
        self.device = None
        self.lock = threading.Lock()
        self.line = None

    def switch(self, on):
        with self.lock:
            if self.device:
                self.device.kill()
                self.device.wait()
                self.device = None
            if on:
                self.device = subprocess.Popen(
                    self.command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
                )
                threading.Thread(target=self.listen, args=(self.device,), daemon=True).start()

    def listen(self, device):
        """Frames of the device go to the tester."""
        for line in device.stdout:
            frame = line.split()[-1]
            identifier, data = frame.split("#")
            kind, rest = "t", f"{len(data) // 2}{data}"
            if data.startswith("R"):
                kind, rest = "r", data[1:] or "0"
            if len(identifier) == 8:
                kind = kind.upper()
            self.say(f"{kind}{identifier}{rest}".encode() + END)

    def say(self, answer):
        line = self.line
        if line:
            try:
                line.sendall(answer)
            except OSError:
                self.line = None

    def take(self, command):
        """Carries out a command of the tester; returns the answer."""
        frame = FRAME.fullmatch(command)
        if frame:
            kind, identifier, length, data = (part.decode() for part in frame.groups())
            text = f"R{length}" if kind in "rR" else data
            with self.lock:
                if self.device:
                    try:
                        self.device.stdin.write(f"(0.0) can0 {identifier}#{text}\n")
                        self.device.stdin.flush()
                    except OSError:
                        pass
            return (b"z" if kind in "tr" else b"Z") + END
        if command[:1] in b"OCSM":
            return END
        return {b"V": b"V1013", b"N": b"NA001", b"F": b"F00"}.get(command[:1], BELL) + END


def serve(port, command):
    bench = Bench(command)
    bench.switch(True)

    class Adapter(socketserver.StreamRequestHandler):
        def handle(self):
            # A frame must not wait until the one before is acknowledged.
            self.request.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            bench.line = self.request
            rest = b""
            while data := self.request.recv(4096):
                *commands, rest = (rest + data).split(END)
                for one in commands:
                    bench.say(bench.take(one))

    class Switch(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            value = self.path.strip("/")
            if value:
                bench.switch(value == "1")
            self.send_response(200)
            self.end_headers()
            self.wfile.write(b"1" if bench.device else b"0")

        def log_message(self, *_):
            pass

    class Server(socketserver.ThreadingTCPServer):
        allow_reuse_address = daemon_threads = True

    switch = http.server.ThreadingHTTPServer(("127.0.0.1", port + 100), Switch)
    threading.Thread(target=switch.serve_forever, daemon=True).start()
    Server(("127.0.0.1", port), Adapter).serve_forever()


if __name__ == "__main__":
    port, device, *harness = sys.argv[1:]
    of_bus = ["--bitrate", "500000"]  # as device-under-test.yaml has it
    serve(int(port), [*(harness or ["harness"]), "serve", device, "--stdio", *of_bus])
