#!/usr/bin/env bash
# Crowds `xavatar view`: 1,000 connections whose requests never end, and 64 poses of as many clients, half of whom leave at once. A client that
# comes then gets the page, and its pose's mesh, within 2 s each; beside it stands how long that takes without the crowd. For a quiet machine:
# .ci/run leaves it out. Skipped where there is no Python.
#   scripts/crowd-test.sh [AVATAR BODY]    an avatar and its body model instead of a smoke demo's
set -euo pipefail
cd "$(dirname "$0")/.."

. scripts/python-module.sh socket
. scripts/dancer.sh "$@"
ulimit -n 4096
cargo build --release --quiet

cat > "$folder/crowd.py" << 'SCRIPT'
import json
import re
import socket
import subprocess
import sys
import time

CONNECTIONS = 1000
POSES = 64
LIMIT = 2.0
PAGE = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"


def pose_of(client):
    body = json.dumps({"pose": {}, "resolution": 64}).encode()
    head = f"POST /mesh HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nX-Client: {client}\r\n"
    return head.encode() + b"Content-Length: %d\r\n\r\n" % len(body) + body


def connected(sent):
    connection = socket.create_connection(address)
    try:
        connection.sendall(sent)
    except OSError:
        pass  # The server has had enough of this one.
    return connection


def answer_to(request):
    """The status of the answer, and the seconds until all of it is there."""
    begin = time.monotonic()
    connection = connected(request)
    received = b""
    while piece := connection.recv(1 << 16):
        received += piece
    return int(received[9:12]), time.monotonic() - begin


server = subprocess.Popen(sys.argv[1:], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
try:
    address = "127.0.0.1", int(re.search(r":(\d+)/", server.stdout.readline())[1])
    asked = {"page": PAGE, "pose": pose_of("honest")}
    alone = {name: answer_to(request) for name, request in asked.items()}
    crowd = [connected(b"GET / HTTP/1.1\r\nHost: local") for _ in range(CONNECTIONS)]
    posing = [connected(pose_of(f"client {number}")) for number in range(POSES)]
    for connection in posing[::2]:
        connection.close()
    crowded = {name: answer_to(request) for name, request in asked.items()}
finally:
    server.terminate()
for name in asked:
    print(f"{name}: {alone[name][1]:.2f} s alone, {crowded[name][1]:.2f} s in the crowd, status {crowded[name][0]}")
sys.exit(0 if all(status == 200 and seconds < LIMIT for status, seconds in crowded.values()) else 1)
SCRIPT
"$python" "$folder/crowd.py" target/release/xavatar view "$avatar" --body "$body" --port 0
